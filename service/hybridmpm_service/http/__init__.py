"""HTTP without routes: requests and answers as data, problems, uploads, and middleware."""
