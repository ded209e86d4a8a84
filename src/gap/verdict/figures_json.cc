#include <nlohmann/json.hpp>
#include <type_traits>

#include "base/json_number.h"
#include "gap/verdict/diagnosis_json.h"

namespace joulecast::gap {
namespace {

using nlohmann::ordered_json;

// One member of each row as an array.
template <class Row, class Value>
ordered_json column(const std::vector<Row>& rows, Value Row::*member) {
  ordered_json values = ordered_json::array();
  for (const Row& row : rows) {
    if constexpr (std::is_same_v<Value, double>)
      values.emplace_back(json_number(row.*member));
    else
      values.emplace_back(row.*member);
  }
  return values;
}

}  // namespace

ordered_json figures_to_json(const Figures& f) {
  using Bin = Figures::Bin;
  using Cell = Figures::Cell;
  using Point = Figures::Point;
  using Mission = Figures::Mission;
  ordered_json maps = ordered_json::array();
  for (const Figures::Map& map : f.maps) {
    maps.push_back({{"axis", map.axis},
                    {"from", column(map.bins, &Bin::from)},
                    {"to", column(map.bins, &Bin::to)},
                    {"label", column(map.bins, &Bin::label)},
                    {"before_w", column(map.bins, &Bin::before_w)},
                    {"after_w", column(map.bins, &Bin::after_w)},
                    {"half_width_w", column(map.bins, &Bin::half_width_w)}});
  }
  return {{"maps", std::move(maps)},
          {"floor",
           {{"cell_m", json_number(f.cell_m)},
            {"x_m", column(f.floor, &Cell::x_m)},
            {"y_m", column(f.floor, &Cell::y_m)},
            {"before_w", column(f.floor, &Cell::before_w)},
            {"after_w", column(f.floor, &Cell::after_w)},
            {"windows", column(f.floor, &Cell::windows)}}},
          {"power",
           {{"mission_id", f.stretch_of},
            {"t_s", column(f.power, &Point::t_s)},
            {"measured_w", column(f.power, &Point::measured_w)},
            {"before_w", column(f.power, &Point::before_w)},
            {"after_w", column(f.power, &Point::after_w)}}},
          {"missions",
           {{"mission_id", column(f.missions, &Mission::mission_id)},
            {"start_utime_us", column(f.missions, &Mission::start_utime_us)},
            {"length_s", column(f.missions, &Mission::length_s)},
            {"payload_kg", column(f.missions, &Mission::payload_kg)},
            {"energy_before", column(f.missions, &Mission::energy_before)},
            {"energy_after", column(f.missions, &Mission::energy_after)},
            {"power_before", column(f.missions, &Mission::power_before)},
            {"power_after", column(f.missions, &Mission::power_after)}}}};
}

}  // namespace joulecast::gap
