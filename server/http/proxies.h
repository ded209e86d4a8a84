#pragma once

// Private to server/http: reverse proxies in front of the service.
#include "server/http/asio.h"
// asio.h stays first.
#include <boost/asio/ip/address.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "server/http/message.h"

namespace joulecast::http {

// Proxies that are trusted to report their clients.
class TrustedProxies {
 public:
  // IP addresses; the error names http.trusted_proxies.
  static Result<TrustedProxies> parse(const std::vector<std::string>& addresses);

  bool contains(const boost::asio::ip::address& address) const;

  // The client behind that peer address of a connection: if it is a trusted proxy, the last address of
  // X-Forwarded-For that is no trusted proxy. An entry that is no address ends the search at the last proxy.
  boost::asio::ip::address client_of(boost::asio::ip::address connection, const Request& request) const;

 private:
  std::vector<boost::asio::ip::address> addresses_;
};

// As itself where it is an IPv4 address mapped into IPv6.
boost::asio::ip::address unmapped(const boost::asio::ip::address& address);

}  // namespace joulecast::http
