"""Steps in short numbers: the setting reaches the products, and only them."""

from __future__ import annotations

import torch

from mocoflow_core.training.precision import in_precision

CPU = torch.device("cpu")


def product(batch, generator):
    weight = torch.ones(4, 4)
    return {"product": weight @ weight, "sum": weight.sum()}


def test_float32_is_the_objective_itself():
    assert in_precision(product, "float32", CPU) is product


def test_bfloat16_shortens_products_and_leaves_sums_as_they_are():
    terms = in_precision(product, "bfloat16", CPU)(None, None)
    assert terms["product"].dtype is torch.bfloat16
    assert terms["sum"].dtype is torch.float32
