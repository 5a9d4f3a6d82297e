"""Laws from raw files of testing machines, made from known laws."""
