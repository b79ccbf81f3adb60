"""The gate between the bytes of a picture or mask and what models see. Nothing else decodes
pictures.

=====================  ==========================================  ==========================================
encoding               as a picture                                as a mask
=====================  ==========================================  ==========================================
PNG, JPEG, TIFF, WebP, accepted                                    accepted
BMP, GIF
JPEG with bytes        accepted: what follows the end of the       same
behind its end, MPO    picture (a video, a second view) is left
JPEG with a part of    refused: "is a truncated JPEG"              same
its scan missing
further pages, frames  the largest page of a TIFF, else the        same
                       first; the warning counts the others
EXIF orientation       applied                                     applied
8-bit gray, color,     as they are                                 background is the value that holds most of
palette, 1, 2, 4 bit                                               the picture and of its border; every other
                                                                   color or index counts as cable
16-bit, 32-bit         scaled by the power of two above the        as above; a soft mask is scaled likewise
integers               maximum, at least 256
floats                 1 is white; above 1 scaled by the power     likewise
                       of two above the maximum
negative, not finite   refused: "has negative values", "has        same
                       values that are not finite"
transparency           left out                                    the mask where transparent is background,
                                                                   or where all colors are one
CMYK, YCbCr            converted to RGB                            same
LAB, HSV               refused: "is in the color space LAB"        same
ICC profile            not applied: values are read as sRGB        same
two values, indices    taken as a mask, with a warning, unless     accepted
on flat ground         the request names a network
white ground           –                                           inverted, with a warning
indices (few values    –                                           accepted, with a warning that lists them
with sharp borders)
gray between           –                                           probability; 0.5 is the default threshold
one value everywhere   warning "is nearly one color"               0: warning; other: refused "is … everywhere"
photograph             accepted                                    refused: "looks like a photograph"
HEIC, AVIF, JPEG XL,   refused by the name of the format           same
PDF, raw files, …
=====================  ==========================================  ==========================================

``headers`` looks at a file without decoding it, for the service; ``decoding`` turns bytes into samples;
``photographs`` and ``masks`` turn samples into what models see.
"""
