#pragma once

#include <string_view>

#include "server/http/text.h"

namespace joulecast::http {

// Whether a header's list ("gzip, br;q=0") admits an item: the list contains it or "*", without q=0. Weak
// validators (W/"x") count as strong ones.
inline bool lists(std::string_view header, std::string_view wanted) {
  bool by_star = false;
  while (!header.empty()) {
    std::string_view item = trim(take_item(header, ','));
    const auto semicolon = item.find(';');
    const bool refused = semicolon != std::string_view::npos &&
                         item.substr(semicolon).find("q=0") != std::string_view::npos &&
                         item.substr(semicolon).find_first_of("123456789") == std::string_view::npos;
    item = trim(item.substr(0, semicolon));
    if (item.starts_with("W/")) item.remove_prefix(2);
    if (equals_ignoring_case(item, wanted)) return !refused;
    if (item == "*" && !refused) by_star = true;
  }
  return by_star;
}

}  // namespace joulecast::http
