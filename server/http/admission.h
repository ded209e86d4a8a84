#pragma once

// Private to server/http: which heads of requests are accepted, and reverse proxies in front of the service.
#include "server/http/asio.h"
// asio.h stays first.
#include <boost/asio/ip/address.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/delivery.h"
#include "server/http/http_server.h"

namespace joulecast::http {

inline std::string_view view(boost::string_view text) {
  return {text.data(), text.size()};
}

struct Denial {
  Refusal refusal = Refusal::malformed;
  unsigned status = 400;
  std::string_view slug;
  std::string detail;
};

// Looks at a head before its body is read. Denying closes the connection: the end of the body may be unknown.
class Admission {
 public:
  // The accepted names in addition to IP addresses, localhost and this host's name; "*" accepts any name.
  // `cors`, which must outlive this: origins with pages that may also request changes.
  Admission(const std::vector<std::string>& allowed_hosts, const Cors& cors);

  // One Authorization at most. Framing (RFC 9112 section 6.3: one Host, one Content-Length at most; no
  // Transfer-Encoding but exactly "chunked", in HTTP/1.1 only), Expect, the Host that the client believes to
  // talk to (a foreign name that resolves to this machine is how a web page reaches it under its own origin),
  // and the conditions and the Origin of requests that change something. `tls`: it came over TLS.
  std::optional<Denial> deny(const boost::beast::http::request_header<boost::beast::http::fields>& head,
                             bool tls) const;

 private:
  bool is_own(std::string_view host) const;
  const Cors& cors_;
  std::vector<std::string> names_;
  bool any_ = false;
};

// Proxies that are trusted to report their clients.
using TrustedProxies = std::set<boost::asio::ip::address>;

// From IP addresses; the error names http.trusted_proxies.
Result<TrustedProxies> parse_proxies(const std::vector<std::string>& addresses);

// The client behind that peer address of a connection: if it is a trusted proxy, the last address of
// X-Forwarded-For that is no trusted proxy. An entry that is no address ends the search at the last proxy.
boost::asio::ip::address client_of(boost::asio::ip::address connection, const TrustedProxies& proxies,
                                   const Request& request);

Result<boost::asio::ip::address> address_of(const std::string& text, const char* setting);
// As itself where it is an IPv4 address mapped into IPv6.
boost::asio::ip::address unmapped(const boost::asio::ip::address& address);

}  // namespace joulecast::http
