"""System 1: self-alignment of a rotary strapdown INS on a ship that sways."""
