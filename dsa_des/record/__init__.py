"""What a run leaves behind: recorded columns, Parquet files, a folder."""
