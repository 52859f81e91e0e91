"""These models describe requests and responses. Requests refuse unknown fields and numbers that are not finite."""
