"""Every work that the project compares itself by, with everyone who does it, in one run."""
