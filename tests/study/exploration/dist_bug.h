#pragma once

#include <optional>
#include <vector>

#include "tests/study/exploration/map.h"

namespace joulecast::exploration {

// The way round the grown obstacles, thesis 5.4: straight to the goal where no obstacle is in between;
// otherwise to the corner of a grown outline that is nearest to the goal among those in reach, and on from
// there. A corner is passed once; one that leads nowhere is left out, since the map is given before driving.
class DistBug {
 public:
  explicit DistBug(const Map& map);

  const std::vector<ConvexPolygon>& grown() const { return grown_; }
  bool inside_grown(Point p) const;
  bool free(Point from, Point to) const;

  // The points from `from` (left out) to `goal` (included); empty when no way leads there.
  std::optional<std::vector<Point>> path(Point from, Point goal) const;

 private:
  std::vector<ConvexPolygon> grown_;
  std::vector<Point> corners_;  // where the robot can stand: on the map, outside every other grown obstacle
};

}  // namespace joulecast::exploration
