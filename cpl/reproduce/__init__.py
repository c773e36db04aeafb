"""Everything again from nothing, compared with what is published."""
