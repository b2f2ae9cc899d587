"""MAVLink microservices as machines without sockets and clocks, both sides."""
