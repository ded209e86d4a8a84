#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/error.h"

namespace joulecast::server {

struct BrokerOptions {
  std::string host;
  int port = 1883;
  bool tls = false;
  std::string authorities;  // PEM file; empty: those of the system
  std::string user, password;
  std::string client_id;
  // What the broker publishes on that topic, retained, when this daemon is gone without a farewell.
  std::string last_topic, last_words;
};

// mqtt://host[:port] (1883) or mqtts://host[:port] (8883, by TLS). Fault::invalid on `field`.
Result<BrokerOptions> parse_broker_url(const std::string& url, const std::string& field);

// A connection to an MQTT 3.1.1 broker, made anew whenever it is lost (after 1 s, and up to 60 s later). Any
// thread.
class BrokerLink {
 public:
  // `on_change(text)` when the connection is made (empty text), and why whenever there is none: a thread of
  // the link's.
  BrokerLink(BrokerOptions options, std::function<void(const std::string& why)> on_change);
  ~BrokerLink();
  BrokerLink(const BrokerLink&) = delete;
  BrokerLink& operator=(const BrokerLink&) = delete;

  // Fault::invalid where the broker's name or the certificate authorities cannot be used at all; that the
  // broker is away is none.
  Result<void> start();
  bool is_connected() const;
  // Fault::unavailable without a connection: nothing waits for one.
  Result<void> publish(const std::string& topic, const std::string& message, int quality, bool retained);
  // Takes leave of the broker.
  void stop();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::server
