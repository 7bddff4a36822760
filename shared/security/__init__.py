"""Who is who: our own authority's certificates, signatures, and who may say what."""
