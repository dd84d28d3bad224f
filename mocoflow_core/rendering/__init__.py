"""From fields to pixels: samples along rays, compositing, views."""
