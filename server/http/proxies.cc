#include "server/http/proxies.h"

#include <algorithm>
#include <ranges>

#include "server/http/text.h"

namespace joulecast::http {

namespace net = boost::asio;

net::ip::address unmapped(const net::ip::address& address) {
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return net::ip::make_address_v4(net::ip::v4_mapped, address.to_v6());
}

Result<TrustedProxies> TrustedProxies::parse(const std::vector<std::string>& addresses) {
  TrustedProxies proxies;
  for (const std::string& text : addresses) {
    boost::system::error_code error;
    proxies.addresses_.push_back(unmapped(net::ip::make_address(text, error)));
    if (error) return invalid("http.trusted_proxies", "must be IP addresses, has " + text);
  }
  return proxies;
}

bool TrustedProxies::contains(const net::ip::address& address) const {
  return std::ranges::find(addresses_, address) != addresses_.end();
}

net::ip::address TrustedProxies::client_of(net::ip::address connection, const Request& request) const {
  connection = unmapped(connection);
  if (!contains(connection)) return connection;
  std::vector<std::string_view> named;  // each proxy adds its peer
  for (const auto& [name, value] : request.headers)
    if (equals_ignoring_case(name, "x-forwarded-for")) named.push_back(value);
  net::ip::address client = connection;
  for (std::string_view line : named | std::views::reverse) {
    for (std::size_t comma = 0; comma != std::string_view::npos;) {
      comma = line.rfind(',');
      const std::size_t begin = comma == std::string_view::npos ? 0 : comma + 1;
      boost::system::error_code error;
      const auto address = net::ip::make_address(std::string(trim(line.substr(begin))), error);
      if (error) return client;
      client = unmapped(address);
      if (!contains(client)) return client;
      line = line.substr(0, comma == std::string_view::npos ? 0 : comma);
    }
  }
  return client;
}

}  // namespace joulecast::http
