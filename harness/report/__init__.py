"""What is shown: tables, pictures and claims, made from records alone."""
