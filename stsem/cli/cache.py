"""`stsem cache`: what is kept between runs, and how to be rid of it."""

import typer

from stsem.cli.launch import verb

app = typer.Typer(help="Show or clear what is kept between runs.")


@app.command("show", help="Where the cache is, and how large.")
@verb
def show() -> int:
    """Print folder, files and size."""
    from stsem.inference.cache import cache_root, usage

    found = usage(cache_root())
    print(f"{found.root}: {found.files} files, {found.bytes / 1e6:.1f} MB")
    return 0


@app.command("clear", help="Remove the kept network outputs and cost profiles.")
@verb
def clear() -> int:
    """Remove everything; runs make it anew."""
    from stsem.inference.cache import cache_root
    from stsem.inference.cache import clear as remove

    removed = remove(cache_root())
    print(f"Removed {removed.files} files, {removed.bytes / 1e6:.1f} MB from {removed.root}")
    return 0
