"""What a record or a result tells about noise, observability and consistency."""
