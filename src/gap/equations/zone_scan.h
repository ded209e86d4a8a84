#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "gap/equations/noise.h"

namespace joulecast::gap {

// A zone that holds every place: its column, masked by position, is the column of any other zone.
inline constexpr Zone everywhere{0, 0, 90};

// The disc of the floor in which the column of the zone effect, tried everywhere, explains most of what other
// coefficients cannot, by a grid over the visited floor, then by pattern search. Empty without positions or
// where no disc explains anything.
std::optional<Zone> find_zone(const ColumnSet& columns, const Rows& rows, const Noise& noise,
                              std::span<const Window> windows);

inline constexpr std::string_view zone_effect = "floor_resistance_zone";

// Whether a cause is resistance in a zone of the floor.
bool is_zone(const Cause& cause);

}  // namespace joulecast::gap
