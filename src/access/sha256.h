#pragma once

#include <string>
#include <string_view>

namespace joulecast::access {

// SHA-256 (FIPS 180-4) as 64 lower-case hexadecimal digits.
std::string sha256_hex(std::string_view bytes);

// Whether both texts are equal, in a time that depends on their lengths alone.
bool equal_in_constant_time(std::string_view a, std::string_view b);

// `bytes` from the operating system's generator as hexadecimal digits, two a byte.
std::string random_hex(int bytes);

}  // namespace joulecast::access
