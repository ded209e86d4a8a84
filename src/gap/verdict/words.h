#pragma once

#include <span>
#include <string>
#include <string_view>

// Formats numbers, ids and lists for people.
namespace joulecast::gap {

// A number in a few digits: 0.0123, 4.5, 1200; a dash where it is unknown.
std::string brief(double value, int digits = 3);
// "0.02 to 0.60": both ends at a resolution that fits the width of the range.
std::string brief_range(double low, double high);
// An id as text: "load rolling resistance", "the covariate cpu load".
std::string words_of(std::string_view id);
// Decimal places that leave a deviation above 0 two significant digits.
int places_of(double deviation);
// "0.0182 ± 0.0011", with the unit where there is one.
std::string with_deviation(double value, double deviation, std::string_view unit);
std::string percent(double fraction, int digits = 2);  // "12 %"
std::string probability_text(double probability);      // "93 %", "> 97 %"
// "a", "a and b", "a, b and c".
std::string enumerate(std::span<const std::string> items, std::string_view last = "and");
std::string sentence(std::string text);  // with a capital and a full stop

}  // namespace joulecast::gap
