#include "battery/cell_shapes.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace joulecast::battery {
namespace {

using Point = std::pair<double, double>;

// Rounded from published low-rate discharges of many makes; good to some tens of millivolts a cell.
constexpr Point lithium_ion_voltage[] = {{0, 3.00},    {0.02, 3.18}, {0.05, 3.34}, {0.10, 3.45}, {0.20, 3.55},
                                         {0.30, 3.60}, {0.40, 3.64}, {0.50, 3.69}, {0.60, 3.77}, {0.70, 3.86},
                                         {0.80, 3.95}, {0.90, 4.06}, {1, 4.18}};
constexpr Point iron_phosphate_voltage[] = {{0, 2.60},    {0.02, 2.90}, {0.05, 3.06}, {0.10, 3.17},
                                            {0.20, 3.23}, {0.30, 3.26}, {0.50, 3.29}, {0.70, 3.31},
                                            {0.90, 3.33}, {0.97, 3.35}, {1, 3.45}};
constexpr Point lead_voltage[] = {{0, 1.90}, {0.2, 1.96}, {0.5, 2.04}, {0.8, 2.10}, {1, 2.13}};

constexpr double lithium_ion_nominal[] = {3.6, 3.65, 3.7};
constexpr double iron_phosphate_nominal[] = {3.2};
constexpr double lead_nominal[] = {2.0, 2.1};

constexpr CellShape shapes[] = {
    {"lithium-ion", lithium_ion_nominal, 3.0, lithium_ion_voltage},
    {"lithium iron phosphate", iron_phosphate_nominal, 2.5, iron_phosphate_voltage},
    {"lead-acid", lead_nominal, 1.75, lead_voltage},
};

constexpr int lead_block = 3;

double scale(double nominal_voltage_v, const CellShape& cell) {
  return nominal_voltage_v /
         Curve({cell.open_circuit_voltage.begin(), cell.open_circuit_voltage.end()}).mean();
}

}  // namespace

Pack detect_pack(double nominal_voltage_v) {
  assert(nominal_voltage_v > 0);
  Pack best{nullptr, 0};
  double least = std::numeric_limits<double>::infinity();
  for (const CellShape& cell : shapes) {
    const int block = &cell == &shapes[2] ? lead_block : 1;
    for (const double nominal : cell.usual_nominal_v) {
      const double blocks = std::max(1.0, std::round(nominal_voltage_v / (block * nominal)));
      const double miss = std::abs(nominal_voltage_v / (blocks * block * nominal) - 1);
      // A thousandth closer is no better: printed voltages are rounded.
      if (miss < least - 1e-3) {
        least = miss;
        best = {&cell, static_cast<int>(blocks) * block};
      }
    }
  }
  return best;
}

std::vector<std::pair<double, double>> default_open_circuit_voltage(double nominal_voltage_v) {
  const CellShape& cell = *detect_pack(nominal_voltage_v).cell;
  const double factor = scale(nominal_voltage_v, cell);
  std::vector<std::pair<double, double>> curve(cell.open_circuit_voltage.begin(),
                                               cell.open_circuit_voltage.end());
  for (auto& [charge, voltage] : curve) voltage *= factor;
  return curve;
}

double default_cutoff_voltage_v(double nominal_voltage_v) {
  const CellShape& cell = *detect_pack(nominal_voltage_v).cell;
  return cell.cutoff_v * scale(nominal_voltage_v, cell);
}

Curve::Curve(std::vector<std::pair<double, double>> points) : points_(std::move(points)) {
  assert(!points_.empty());
}

// The index of the point that starts the piece on which x lies; the end pieces reach to infinity.
std::size_t Curve::piece(double x) const {
  const auto above = std::upper_bound(points_.begin() + 1, points_.end() - 1, x,
                                      [](double value, const auto& point) { return value < point.first; });
  return static_cast<std::size_t>(above - points_.begin()) - 1;
}

double Curve::held(double x) const {
  return extended(std::clamp(x, points_.front().first, points_.back().first));
}

double Curve::extended(double x) const {
  if (points_.size() == 1) return points_.front().second;
  const std::size_t i = piece(x);
  const auto& [x0, y0] = points_[i];
  const auto& [x1, y1] = points_[i + 1];
  return y0 + (y1 - y0) * ((x - x0) / (x1 - x0));
}

double Curve::mean() const {
  if (points_.size() == 1) return points_.front().second;
  double area = 0;
  for (std::size_t i = 1; i < points_.size(); ++i)
    area += (points_[i].first - points_[i - 1].first) * (points_[i].second + points_[i - 1].second) / 2;
  return area / (points_.back().first - points_.front().first);
}

}  // namespace joulecast::battery
