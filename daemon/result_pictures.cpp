#include "daemon/result_pictures.hpp"

#include "algo/render/error_image.hpp"
#include "algo/render/overlay_image.hpp"

namespace plumb {

ResultPictures DrawResultPictures(const Scene& reference, const Comparison& comparison, const CompareOptions& options,
                                  const std::string& subtitle, bool paper_colors) {
  ResultPictures pictures;
  if (!reference.height_map) return pictures;
  if (comparison.deviation) {
    ErrorImageOptions error{.tolerance_m = options.shift_tolerance_m, .paper_colors = paper_colors, .subtitle = subtitle};
    if (comparison.deviation->grid == reference.height_map->grid) error.relief = &*reference.height_map;
    if (comparison.region_mask.size() == comparison.deviation->grid.num_cells()) error.region_mask = comparison.region_mask;
    pictures.error_map = DrawErrorImage(*comparison.deviation, error);
  }
  if (comparison.current_height && comparison.current_height->grid == reference.height_map->grid) {
    pictures.overlay = DrawOverlayImage(*reference.height_map, *comparison.current_height,
                                        {.tolerance_m = options.shift_tolerance_m, .subtitle = subtitle});
  }
  return pictures;
}

}  // namespace plumb
