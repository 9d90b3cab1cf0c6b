"""Views of a document: Markdown, HTML, plots, tables, and the folder that holds them. They compute no result."""
