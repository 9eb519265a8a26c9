"""Which parameters measurements can tell, and what keeps the others from it (section 1.4.4.2)."""
