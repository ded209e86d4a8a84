#pragma once

#include <array>
#include <string>
#include <string_view>

// Format of numbers in reports: a dash for an unknown number, degrees after radians.
namespace joulecast::report {

// "0.0182 ± 0.0011 N m", "0.0163 ± 0.0008 rad (0.934 ± 0.046°)".
std::string quantity(double value, double deviation, std::string_view unit);
std::string quantity(double value, std::string_view unit);
// "0.20 to 0.40 m/s", with degrees after radians.
std::string quantity_range(double from, double to, std::string_view unit);
// The unit in degrees, "°" for "rad"; empty for a unit that is not of angles.
std::string_view degrees_of(std::string_view unit);
double in_degrees(double radians);
// Unit at the end of a name: "m/s" of "speed_m_s"; empty where there is no unit.
std::string_view unit_of(std::string_view name);
std::string_view without_unit(std::string_view name);  // "speed" of "speed_m_s"

std::string share_text(double fraction);                                         // "12 %"
std::string share_text(double fraction, const std::array<double, 2>& interval);  // "12 % [8 %, 16 %]"
std::string chance_text(double probability);
std::string count_text(std::size_t count, std::string_view noun);  // "1 mission", "2 missions"
std::string capital(std::string text);

}  // namespace joulecast::report
