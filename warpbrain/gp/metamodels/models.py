"""The meta-models by name."""

from __future__ import annotations

from warpbrain.gp.metamodels.meta_model import MetaModel
from warpbrain.gp.metamodels.mooney_rivlin import MooneyRivlinMetaModel
from warpbrain.gp.metamodels.neo_hookean import NeoHookeanMetaModel
from warpbrain.gp.metamodels.ogden import OgdenMetaModel

#: Meta-models by the name of their law.
METAMODELS: dict[str, MetaModel] = {
    model.name: model for model in (NeoHookeanMetaModel(), MooneyRivlinMetaModel(), OgdenMetaModel())
}

__all__ = ["METAMODELS", "MetaModel"]
