#include "http_client/http_client.h"

#include <algorithm>
#include <cctype>

namespace joulecast::http_client {

Result<ServerAddress> parse_url(std::string_view url, const std::string& field) {
  const bool tls = url.starts_with("https://");
  if (tls || url.starts_with("http://")) {
    url.remove_prefix(tls ? 8 : 7);
  } else if (url.find("://") != std::string_view::npos) {
    return invalid(field, "must begin with http:// or https://");
  }
  const std::size_t slash = std::min(url.find_first_of("/?#"), url.size());
  std::string_view authority = url.substr(0, slash);
  std::string_view path = url.substr(slash);
  if (path.starts_with('?') || path.starts_with('#')) return invalid(field, "must have a path before that");
  while (path.find('?') == std::string_view::npos && path.ends_with('/')) path.remove_suffix(1);
  ServerAddress address{{}, tls ? "443" : "80", std::string(path), tls};
  if (authority.find('@') != std::string_view::npos)
    return invalid(field, "must have no user name or password");
  // A colon inside brackets belongs to an IPv6 address.
  const std::size_t bracket = authority.rfind(']');
  const std::size_t colon = authority.rfind(':');
  if (colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket)) {
    address.port = std::string(authority.substr(colon + 1));
    authority = authority.substr(0, colon);
    const bool digits = std::all_of(address.port.begin(), address.port.end(),
                                    [](unsigned char c) { return std::isdigit(c) != 0; });
    if (address.port.empty() || address.port.size() > 5 || !digits || std::stoi(address.port) > 65535)
      return invalid(field, "has no valid port");
  }
  if (authority.starts_with('[') && authority.ends_with(']'))
    authority = authority.substr(1, authority.size() - 2);
  if (authority.empty()) return invalid(field, "names no host");
  address.host = std::string(authority);
  return address;
}

}  // namespace joulecast::http_client
