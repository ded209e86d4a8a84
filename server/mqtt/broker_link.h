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
  // Will message: the broker publishes it on that topic, retained, when this daemon disappears without a
  // disconnect.
  std::string last_topic, last_words;
};

// mqtt://host[:port] (1883) or mqtts://host[:port] (8883, by TLS). Fault::invalid on `field`.
Result<BrokerOptions> parse_broker_url(const std::string& url, const std::string& field);

// A connection to an MQTT 3.1.1 broker, made again whenever it is lost (after 1 s, and up to 60 s later). Any
// thread.
class BrokerLink {
 public:
  // `on_change(text)` is called with an empty text when the connection is made, and with the reason when it
  // is lost or fails: on a thread of the link's.
  BrokerLink(BrokerOptions options, std::function<void(const std::string& why)> on_change);
  ~BrokerLink();
  BrokerLink(const BrokerLink&) = delete;
  BrokerLink& operator=(const BrokerLink&) = delete;

  // Fault::invalid where the broker's name or the certificate authorities are unusable; an unreachable broker
  // is no fault.
  Result<void> start();
  bool is_connected() const;
  // Fault::unavailable without a connection; the message is not queued.
  Result<void> publish(const std::string& topic, const std::string& message, int quality, bool retained);
  // Disconnects from the broker.
  void stop();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::server
