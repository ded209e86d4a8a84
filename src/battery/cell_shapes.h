#pragma once

#include <span>
#include <string_view>
#include <utility>
#include <vector>

namespace joulecast::battery {

// A typical cell of one chemistry, used until a battery is calibrated.
struct CellShape {
  std::string_view chemistry;
  std::span<const double> usual_nominal_v;  // as printed by makers, for one cell
  double cutoff_v;
  std::span<const std::pair<double, double>> open_circuit_voltage;  // (charge, V), from 0 to 1
};

struct Pack {
  const CellShape* cell;
  int cells_in_series;
};

// The chemistry and count with the printed voltage closest to `nominal_voltage_v` > 0; of equally close ones
// lithium-ion, then iron phosphate, then lead. Lead comes in blocks of three cells (6 V) only.
Pack detect_pack(double nominal_voltage_v);

// The pack's open-circuit voltage, scaled so that its mean over charge is the nominal voltage: a full pack
// holds nominal_voltage_v * capacity_ah watt-hours.
std::vector<std::pair<double, double>> default_open_circuit_voltage(double nominal_voltage_v);

double default_cutoff_voltage_v(double nominal_voltage_v);

// A piecewise linear function through points of ascending x.
class Curve {
 public:
  // At least one point, x strictly ascending.
  explicit Curve(std::vector<std::pair<double, double>> points);

  double held(double x) const;      // constant beyond the ends
  double extended(double x) const;  // beyond the ends, along the first and the last piece
  double mean() const;              // over [first x, last x]

  const std::vector<std::pair<double, double>>& points() const { return points_; }

 private:
  std::size_t piece(double x) const;

  std::vector<std::pair<double, double>> points_;
};

}  // namespace joulecast::battery
