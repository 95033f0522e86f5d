"""One offline HTML page in which an equilibrium set can be turned, walked on and asked."""

from equimorph.explorer.page import explore as explore
