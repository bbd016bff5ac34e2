"""The results of a run: recorded columns, Parquet files, a folder."""
