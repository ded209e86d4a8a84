#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

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
  // The file or, without its password, the URL of the history.
  std::string store_name() const;

  // True while every loop turns: receiving, accounting, writing, HTTP. What the watchdog asks.
  bool alive();

  // Reads again what may change while it runs: the tokens and the certificate. What cannot be read is logged,
  // and what was in force stays.
  void reload();

  // Stops in order: receiving, accounting (open missions are checkpointed), HTTP, writing. What the store
  // does not take goes to the spool beside it. False when a part did not end in time: the process is to end
  // by _exit().
  bool stop();

 private:
  struct Parts;
  explicit Application(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

// The SQLite file of the history. Fault::invalid on "store.url" where the history is in PostgreSQL, whose own
// programs check it, back it up and restore it.
Result<std::string> store_file(const Settings& settings);

// The OpenAPI document of the table that start() would serve.
Result<std::string> openapi_document();

}  // namespace joulecast
