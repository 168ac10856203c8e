"""What stands between a connection and the routes: uvicorn's protocols and the middleware."""
