#include "server/mqtt/broker_link.h"

#include <mosquitto.h>

#include <atomic>
#include <charconv>
#include <utility>

#include "http_client/http_client.h"

namespace joulecast::server {
namespace {

constexpr int keep_alive_s = 15;
constexpr unsigned first_pause_s = 1, last_pause_s = 60;

Result<void> done(int code, const char* field) {
  if (code == MOSQ_ERR_SUCCESS) return {};
  return fail(code == MOSQ_ERR_NO_CONN ? Fault::unavailable : Fault::invalid, field,
              mosquitto_strerror(code));
}

}  // namespace

Result<BrokerOptions> parse_broker_url(const std::string& url, const std::string& field) {
  const bool tls = url.starts_with("mqtts://");
  if (!tls && !url.starts_with("mqtt://"))
    return invalid(field, "must be mqtt://host[:port] or mqtts://host[:port]");
  const auto parsed = http_client::parse_url("http" + url.substr(4), field);
  if (!parsed || !parsed->base_path.empty())
    return invalid(field, "must be mqtt://host[:port] or mqtts://host[:port]");
  BrokerOptions options;
  options.host = parsed->host;
  options.tls = tls;
  options.port = tls ? 8883 : 1883;
  // The port that an HTTP URL has when it states none.
  if (parsed->port != (tls ? "443" : "80") || url.ends_with(":" + parsed->port))
    std::from_chars(parsed->port.data(), parsed->port.data() + parsed->port.size(), options.port);
  return options;
}

class BrokerLink::Impl {
 public:
  Impl(BrokerOptions options, std::function<void(const std::string&)> on_change)
      : options_(std::move(options)), on_change_(std::move(on_change)) {}
  ~Impl() { stop(); }

  Result<void> start() {
    mosquitto_lib_init();
    handle_ = mosquitto_new(options_.client_id.c_str(), true, this);
    if (handle_ == nullptr) return fail(Fault::internal, "mqtt.url", "no memory for the connection");
    mosquitto_connect_callback_set(
        handle_, [](mosquitto*, void* self, int code) { static_cast<Impl*>(self)->on_connect(code); });
    mosquitto_disconnect_callback_set(
        handle_, [](mosquitto*, void* self, int code) { static_cast<Impl*>(self)->on_disconnect(code); });
    mosquitto_reconnect_delay_set(handle_, first_pause_s, last_pause_s, true);
    Result<void> set;
    if (options_.tls) set = set_tls();
    if (set && !options_.user.empty())
      set = done(mosquitto_username_pw_set(handle_, options_.user.c_str(), options_.password.c_str()),
                 "mqtt.user");
    if (set)
      set = done(mosquitto_will_set(handle_, options_.last_topic.c_str(),
                                    static_cast<int>(options_.last_words.size()), options_.last_words.data(),
                                    1, true),
                 "mqtt.interface");
    if (!set) return set;
    // Whether the broker is there now does not matter: the thread goes on trying.
    if (const int code = mosquitto_connect_async(handle_, options_.host.c_str(), options_.port, keep_alive_s);
        code == MOSQ_ERR_INVAL)
      return done(code, "mqtt.url");
    running_ = true;
    return done(mosquitto_loop_start(handle_), "mqtt.url");
  }

  Result<void> set_tls() {
    if (options_.authorities.empty())
      return done(mosquitto_int_option(handle_, MOSQ_OPT_TLS_USE_OS_CERTS, 1), "mqtt.authorities");
    return done(mosquitto_tls_set(handle_, options_.authorities.c_str(), nullptr, nullptr, nullptr, nullptr),
                "mqtt.authorities");
  }

  bool is_connected() const { return connected_; }

  Result<void> publish(const std::string& topic, const std::string& message, int quality, bool retained) {
    if (!connected_) return fail(Fault::unavailable, "mqtt.url", "the broker is not connected");
    return done(mosquitto_publish(handle_, nullptr, topic.c_str(), static_cast<int>(message.size()),
                                  message.data(), quality, retained),
                "mqtt.url");
  }

  void stop() {
    if (handle_ == nullptr) return;
    if (running_) {
      running_ = false;
      mosquitto_disconnect(handle_);
      mosquitto_loop_stop(handle_, !connected_);
    }
    mosquitto_destroy(std::exchange(handle_, nullptr));
    mosquitto_lib_cleanup();
  }

 private:
  void on_connect(int code) {
    connected_ = code == 0;
    on_change_(code == 0 ? "" : mosquitto_connack_string(code));
  }
  void on_disconnect(int code) {
    connected_ = false;
    if (code != 0) on_change_(mosquitto_strerror(code));
  }

  const BrokerOptions options_;
  const std::function<void(const std::string&)> on_change_;
  mosquitto* handle_ = nullptr;
  bool running_ = false;
  std::atomic<bool> connected_ = false;
};

BrokerLink::BrokerLink(BrokerOptions options, std::function<void(const std::string& why)> on_change)
    : impl_(std::make_unique<Impl>(std::move(options), std::move(on_change))) {}
BrokerLink::~BrokerLink() = default;
Result<void> BrokerLink::start() {
  return impl_->start();
}
bool BrokerLink::is_connected() const {
  return impl_->is_connected();
}
Result<void> BrokerLink::publish(const std::string& topic, const std::string& message, int quality,
                                 bool retained) {
  return impl_->publish(topic, message, quality, retained);
}
void BrokerLink::stop() {
  impl_->stop();
}

}  // namespace joulecast::server
