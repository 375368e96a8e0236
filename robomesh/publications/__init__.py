"""What is published and subscribed to: order, losses, the values that late joiners get."""
