"""Measurements that aid an INS: one compiled row a file, and what turns a record into them."""
