//! Several nodes on one computer: network namespaces, a bridge between them, and nothing left behind.
