"""The nodes' parameters: one module and one frozen data class a node."""
