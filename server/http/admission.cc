#include "server/http/admission.h"

#include <algorithm>
#include <ranges>

#include "base/try.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

namespace net = boost::asio;
namespace bhttp = boost::beast::http;

// "name:80" -> "name", "[::1]:80" -> "::1"; a root dot at the end is no part of the name. Empty for none.
std::string_view name_of(std::string_view authority) {
  if (authority.starts_with('[')) {
    const auto close = authority.find(']');
    const std::string_view rest = authority.substr(std::min(close, authority.size() - 1) + 1);
    return close != std::string_view::npos && (rest.empty() || rest.starts_with(':'))
               ? authority.substr(1, close - 1)
               : std::string_view();
  }
  authority = authority.substr(0, authority.find(':'));
  if (authority.ends_with('.')) authority.remove_suffix(1);
  return authority;
}

bool changes_something(bhttp::verb method) {
  return method != bhttp::verb::get && method != bhttp::verb::head && method != bhttp::verb::options;
}

}  // namespace

Admission::Admission(const std::vector<std::string>& allowed_hosts, const Cors& cors)
    : cors_(cors), names_(allowed_hosts) {
  any_ = std::ranges::find(names_, "*") != names_.end();
  names_.emplace_back("localhost");
  boost::system::error_code error;
  if (std::string own = net::ip::host_name(error); !error) names_.push_back(std::move(own));
}

// An IP address is not subject to DNS rebinding, so every one is accepted.
bool Admission::is_own(std::string_view host) const {
  if (any_ || std::ranges::any_of(names_, [&](const auto& n) { return equals_ignoring_case(n, host); }))
    return true;
  boost::system::error_code error;
  net::ip::make_address(std::string(host), error);
  return !error;
}

std::optional<Denial> Admission::deny(const bhttp::request_header<bhttp::fields>& head, bool tls) const {
  const auto malformed = [](std::string detail) {
    return Denial{Refusal::malformed, 400, "malformed-request", std::move(detail)};
  };
  const auto count = [&](bhttp::field name) { return head.count(name); };
  const auto value_of = [&](bhttp::field name) { return view(head[name]); };
  if (count(bhttp::field::transfer_encoding) > 0 &&
      (count(bhttp::field::transfer_encoding) > 1 || head.version() < 11 ||
       !equals_ignoring_case(trimmed(value_of(bhttp::field::transfer_encoding)), "chunked")))
    return malformed("Transfer-Encoding must be exactly chunked, once, in HTTP/1.1");
  // A repeated or listed length is allowed by the RFC where all agree; others may read it otherwise.
  if (count(bhttp::field::content_length) > 1 ||
      value_of(bhttp::field::content_length).find_first_not_of("0123456789") != std::string_view::npos)
    return malformed("Content-Length must be one number");
  const std::size_t hosts = count(bhttp::field::host), origins = count(bhttp::field::origin);
  if (hosts > 1 || (hosts == 0 && head.version() >= 11))
    return malformed("HTTP/1.1 needs exactly one Host header");
  if (count(bhttp::field::authorization) > 1) return malformed("Authorization must be present once at most");
  const auto [expect, last] = head.equal_range(bhttp::field::expect);
  if (head.version() >= 11 && std::any_of(expect, last, [](const auto& field) {
        return !equals_ignoring_case(trimmed(view(field.value())), "100-continue");
      }))
    return Denial{Refusal::malformed, 417, "expectation-failed",
                  "Only the expectation 100-continue is supported here"};
  std::string_view host = value_of(bhttp::field::host), origin = value_of(bhttp::field::origin);
  // The authority of a target in absolute form replaces Host (RFC 9112 section 3.2.2).
  const std::string_view target = view(head.target());
  if (const auto scheme = target.find("://"); scheme != std::string_view::npos && !target.starts_with('/')) {
    host = target.substr(scheme + 3);
    host = host.substr(0, host.find_first_of("/?#"));
  }
  // A condition that is not checked must not be taken as satisfied (RFC 9110 section 13.1.1).
  if (changes_something(head.method()) &&
      count(bhttp::field::if_match) + count(bhttp::field::if_unmodified_since) > 0)
    return Denial{Refusal::malformed, 412, "precondition-failed",
                  "Changes under If-Match or If-Unmodified-Since are not supported"};
  if (hosts > 0 && !is_own(name_of(host)))
    return Denial{Refusal::host, 421, "misdirected",
                  "Host names no address or name of this service; http.allowed_hosts adds names"};
  if (origins > 0 && changes_something(head.method())) {
    const auto scheme = origin.find("://");
    const bool own = scheme != std::string_view::npos &&
                     (!tls || equals_ignoring_case(origin.substr(0, scheme), "https")) &&
                     equals_ignoring_case(origin.substr(scheme + 3), host);
    if (origins > 1 || (!own && !cors_.allows(origin)))
      return Denial{Refusal::origin, 403, "foreign-origin",
                    "A page may change something only under the host it came from; Origin differs from Host, "
                    "and http.allowed_origins does not have it"};
  }
  return std::nullopt;
}

net::ip::address unmapped(const net::ip::address& address) {
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return net::ip::make_address_v4(net::ip::v4_mapped, address.to_v6());
}

Result<net::ip::address> address_of(const std::string& text, const char* setting) {
  boost::system::error_code error;
  const auto address = net::ip::make_address(text, error);
  if (error) return invalid(setting, "must be an IPv4 or IPv6 address, is " + text);
  return address;
}

Result<TrustedProxies> parse_proxies(const std::vector<std::string>& addresses) {
  TrustedProxies proxies;
  for (const std::string& text : addresses) {
    TRY_ASSIGN(const auto address, address_of(text, "http.trusted_proxies"));
    proxies.insert(unmapped(address));
  }
  return proxies;
}

net::ip::address client_of(net::ip::address connection, const TrustedProxies& proxies,
                           const Request& request) {
  connection = unmapped(connection);
  if (!proxies.contains(connection)) return connection;
  std::vector<std::string_view> named;  // each proxy adds its peer
  for (const auto& [name, value] : request.headers)
    if (equals_ignoring_case(name, "x-forwarded-for")) named.push_back(value);
  net::ip::address client = connection;
  for (std::string_view line : named | std::views::reverse) {
    for (std::size_t comma = 0; comma != std::string_view::npos;) {
      comma = line.rfind(',');
      const std::size_t begin = comma == std::string_view::npos ? 0 : comma + 1;
      boost::system::error_code error;
      const auto address = net::ip::make_address(std::string(trimmed(line.substr(begin))), error);
      if (error) return client;
      client = unmapped(address);
      if (!proxies.contains(client)) return client;
      line = line.substr(0, comma == std::string_view::npos ? 0 : comma);
    }
  }
  return client;
}

}  // namespace joulecast::http
