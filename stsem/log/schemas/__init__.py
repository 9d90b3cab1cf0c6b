"""What messages say: one file of readers per schema family, and the table that names them."""
