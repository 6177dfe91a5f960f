// Inner loops of the image, in the order of the data; kernel_*_hot.c include this file once for
// each instruction set.
#include "echo/kernel_rows.h"
#include "echo/kernel_tissue.h"
#include "echo/kernel_walls.h"
#include "echo/kernel_splat.h"
#include "echo/kernel_beam.h"
#include "echo/kernel_display.h"
#include "echo/kernel_picture.h"

const echo_kernels SONDE_KERNELS = {SONDE_KERNELS_NAME,
                                    splat,
                                    warp_tissue,
                                    smooth_tissue,
                                    stream,
                                    lateral,
                                    axial,
                                    tissue,
                                    merge,
                                    widen,
                                    fade,
                                    convert,
                                    look,
                                    compress,
                                    smooth_lines,
                                    show};
