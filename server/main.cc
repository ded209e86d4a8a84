#include <sys/stat.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <csignal>

#include "history/store_care.h"
#include "server/application.h"
#include "server/daemon_options.h"
#include "server/logging.h"
#include "server/settings.h"

namespace {

using joulecast::Invocation;

// The signals that run() waits for.
sigset_t awaited_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int each : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, each);
  return signals;
}

// Waits for SIGINT or SIGTERM, reloads at SIGHUP, feeding the watchdog while every loop turns.
void run(joulecast::Application& application) {
  const sigset_t signals = awaited_signals();
  std::uint64_t watchdog_us = 0;
  const bool watched = sd_watchdog_enabled(0, &watchdog_us) > 0;
  const std::uint64_t period_us = watched ? watchdog_us / 3 : 10'000'000;
  const timespec period{static_cast<time_t>(period_us / 1'000'000),
                        static_cast<long>(period_us % 1'000'000 * 1000)};
  for (;;) {
    const int signal = sigtimedwait(&signals, nullptr, &period);
    if (signal == SIGINT || signal == SIGTERM) return;
    if (signal == SIGHUP) application.reload();
    if (application.alive() && watched) sd_notify(0, "WATCHDOG=1");
  }
}

int serve(const joulecast::DaemonOptions& options) {
  joulecast::configure_logging(options.log_format, options.log_level);
  // Every thread inherits the mask, so that only run() sees these signals.
  const sigset_t signals = awaited_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);

  auto application = joulecast::Application::start(options);
  if (!application) {
    joulecast::log_error("cannot start", application.error());
    return 1;
  }
  joulecast::log_info("ready",
                      {{"http", (options.http.tls.certificate.empty() ? "http://" : "https://") +
                                    options.http.address + ":" + std::to_string((*application)->http_port())},
                       {"lcm", options.ingest.lcm_url},
                       {"store", (*application)->store_name()}});
  sd_notify(0, "READY=1");
  run(**application);
  sd_notify(0, "STOPPING=1");
  joulecast::log_info("stopping");
  const bool ended = (*application)->stop();
  joulecast::log_info(ended ? "stopped" : "stopped; unfinished work was abandoned");
  // All data are written; a computation that cannot be cancelled does not delay the end.
  if (!ended) std::_Exit(EXIT_SUCCESS);
  return 0;
}

void complain(const joulecast::Error& error) {
  std::fprintf(stderr, "joulecastd: %s\n", joulecast::describe(error).c_str());
}

int print(const joulecast::Result<std::string>& text) {
  if (!text) {
    complain(text.error());
    return 1;
  }
  std::fputs(text->c_str(), stdout);
  return 0;
}

int check(const joulecast::DaemonOptions& options) {
  const auto faulty = joulecast::faults_of(options);
  for (const joulecast::Error& error : faulty) complain(error);
  return faulty.empty() ? print(std::string("the settings are valid\n")) : 2;
}

int check_store(const std::string& path) {
  const auto check = joulecast::history::check_store(path);
  if (!check) {
    complain(check.error());
    return check.error().fault == joulecast::Fault::corrupt ? 3 : 1;
  }
  for (const std::string& fault : check->faults) std::printf("%s\n", fault.c_str());
  std::printf("%s: %lld missions and %lld chunks of recordings are %s\n", path.c_str(),
              static_cast<long long>(check->missions), static_cast<long long>(check->chunks),
              check->faults.empty() ? "sound" : "not all sound");
  return check->faults.empty() ? 0 : 3;
}

int salvage(const std::string& path, const std::string& into) {
  const auto salvaged = joulecast::history::salvage_store(path, into);
  if (!salvaged) return print(tl::unexpected(salvaged.error()));
  for (const std::string& loss : salvaged->losses) std::printf("lost: %s\n", loss.c_str());
  std::printf("%lld rows kept in %s\n", static_cast<long long>(salvaged->rows), into.c_str());
  return salvaged->losses.empty() ? 0 : 3;
}

int back_up(const std::string& path, const std::string& file) {
  return print(joulecast::history::back_up_store(path, file).map([&](const auto& check) {
    return std::to_string(check.missions) + " missions copied into " + file + "\n";
  }));
}

int restore(const std::string& file, const std::string& path) {
  return print(joulecast::history::restore_store(file, path).map([&](const std::string& before) {
    return path + " is restored" + (before.empty() ? "" : "; the previous file is " + before) + "\n";
  }));
}

int care_for_store(const Invocation& invocation) {
  const auto path = joulecast::store_file(invocation.settings.options());
  if (!path) {
    complain(path.error());
    return 2;
  }
  switch (invocation.action) {
    case Invocation::Action::backup:
      return back_up(*path, invocation.file);
    case Invocation::Action::restore:
      return restore(invocation.file, *path);
    case Invocation::Action::salvage:
      return salvage(*path, invocation.file);
    default:
      return check_store(*path);
  }
}

}  // namespace

int main(int argc, char** argv) {
  // Only this user and its group may access histories, spools and backups, whatever the caller's umask.
  const mode_t allowed = umask(0077);
  umask(allowed | 0007);
  const auto invocation = joulecast::read_settings({argv + 1, argv + argc}, joulecast::process_environment());
  if (!invocation) {
    complain(invocation.error());
    return 2;
  }
  switch (invocation->action) {
    case Invocation::Action::help:
      return print(joulecast::settings_help());
    case Invocation::Action::version:
      return print(std::string("joulecastd " JOULECAST_VERSION "\n"));
    case Invocation::Action::check_config:
      return check(invocation->settings.options());
    case Invocation::Action::print_config:
      return print(invocation->settings.print());
    case Invocation::Action::print_openapi:
      return print(joulecast::openapi_document());
    case Invocation::Action::print_config_schema:
      return print(joulecast::settings_schema());
    case Invocation::Action::check_store:
    case Invocation::Action::backup:
    case Invocation::Action::restore:
    case Invocation::Action::salvage:
      return care_for_store(*invocation);
    case Invocation::Action::run:
      return serve(invocation->settings.options());
  }
  return 2;
}
