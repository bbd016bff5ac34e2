"""What makes the pages, figures and made-up files of the project again; none of it is shipped."""
