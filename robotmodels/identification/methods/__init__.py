"""Methods of identification: small frozen objects that solve equations."""
