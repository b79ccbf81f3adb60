"""``dlo bridge``: recipes for controllers that speak neither HTTP nor JSON, over TCP as text lines
or fixed bytes."""
