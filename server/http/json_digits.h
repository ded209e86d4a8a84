#pragma once

#include <string>
#include <string_view>

namespace joulecast::http {

// Significant digits of the numbers in answers: a micrometre in ten kilometres, a tenth of a millijoule in a
// megajoule, and finer than any sensor. A double has 17.
inline constexpr int usual_digits = 10;
inline constexpr int all_digits = 17;

// Rounds the numbers of a JSON text that have a fraction or an exponent to at most `digits` significant ones,
// half away from zero; digits before the point stay. Integers, text and the text's layout stay as they are.
void round_numbers(std::string& json, int digits);

// The same of one number written in decimals.
std::string rounded_number(std::string_view number, int digits);

}  // namespace joulecast::http
