"""Small logs in the dialects of this field, all made from one simulated truth, each with what is to become of it."""
