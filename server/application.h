#pragma once

#include <cstdint>
#include <memory>

#include "base/error.h"
#include "server/settings.h"

namespace joulecast {

// joulecastd put together: store and writer, models, ingest, HTTP. The one place where the parts meet.
class Application {
 public:
  // Opens the store, loads the models, starts ingest and HTTP. When it returns, the service answers.
  static Result<std::unique_ptr<Application>> start(const Settings& settings);
  ~Application();
  Application(const Application&) = delete;
  Application& operator=(const Application&) = delete;

  // The port really bound.
  std::uint16_t http_port() const;

  // True while every loop turns: receiving, accounting, writing, HTTP. What the watchdog asks.
  bool alive();

  // Stops in order: receiving, accounting (open missions are checkpointed), HTTP, writing.
  void stop();
  // False after a stop while a request still computes that could not be cancelled: destruction waits for it.
  bool ended() const;

 private:
  struct Parts;
  explicit Application(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

// The OpenAPI document of the table that start() would serve.
Result<std::string> openapi_document();

}  // namespace joulecast
