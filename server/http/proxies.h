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

// Those whose word about their clients is taken.
class TrustedProxies {
 public:
  // IP addresses; the error names http.trusted_proxies.
  static Result<TrustedProxies> parse(const std::vector<std::string>& addresses);

  bool contains(const boost::asio::ip::address& address) const;

  // Whom a request is from that came from that end of the connection: where that is a proxy, the last address
  // of X-Forwarded-For that is none. What is no address there ends the search at the last proxy.
  boost::asio::ip::address client_of(boost::asio::ip::address connection, const Request& request) const;

 private:
  std::vector<boost::asio::ip::address> addresses_;
};

// As itself where it is an IPv4 address mapped into IPv6.
boost::asio::ip::address unmapped(const boost::asio::ip::address& address);

}  // namespace joulecast::http
