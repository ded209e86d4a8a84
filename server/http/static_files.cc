#include "server/http/static_files.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "base/text_file.h"
#include "server/http/delivery.h"

namespace joulecast::http {
namespace {

constexpr const char* content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

std::string content_type_of(std::string_view name) {
  static constexpr std::pair<std::string_view, const char*> types[] = {
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".ico", "image/x-icon"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
      {".webmanifest", "application/manifest+json"}};
  for (const auto& [ending, type] : types)
    if (name.ends_with(ending)) return type;
  return "application/octet-stream";
}

// "name.<eight or more hexadecimal digits>.ext"
bool has_hash_in_name(std::string_view name) {
  const auto last = name.rfind('.');
  if (last == std::string_view::npos || last == 0) return false;
  const auto before = name.find_last_of(".-", last - 1);
  if (before == std::string_view::npos || last - before < 9) return false;
  return name.substr(before + 1, last - before - 1).find_first_not_of("0123456789abcdefABCDEF") ==
         std::string_view::npos;
}

void add_endpoints(std::vector<Endpoint>& endpoints, std::string_view name, std::string bytes) {
  const std::string content_type = content_type_of(name);
  const auto asset = std::make_shared<const Asset>(
      std::move(bytes), content_type,
      has_hash_in_name(name) ? "public, max-age=31536000, immutable" : "no-cache");

  Endpoint endpoint{.path = "/" + std::string(name),
                    .operation_id = "getAsset",
                    .role = Role::open,
                    .summary = "File of the operator page",
                    .response_type = content_type,
                    .run = Run::io,
                    .documented = false,
                    .handler = [asset](const Request& request) -> Result<Response> {
                      Response response = asset->answer(request);
                      response.headers.emplace_back("Content-Security-Policy", content_security_policy);
                      response.headers.emplace_back("Referrer-Policy", "no-referrer");
                      return response;
                    }};
  endpoints.push_back(endpoint);
  if (name == "index.html") {
    endpoint.path = "/";
    endpoint.operation_id = "getOperatorPage";
    endpoint.summary = "The operator page";
    endpoint.documented = true;
    endpoints.push_back(std::move(endpoint));
  } else if (name.ends_with(".html")) {
    endpoint.path.resize(endpoint.path.size() - 5);
    endpoints.push_back(std::move(endpoint));
  }
}

}  // namespace

std::vector<Endpoint> asset_endpoints(std::span<const EmbeddedFile> files) {
  std::vector<Endpoint> endpoints;
  for (const EmbeddedFile& file : files) add_endpoints(endpoints, file.name, std::string(file.bytes));
  return endpoints;
}

Result<std::vector<Endpoint>> asset_endpoints_from(const std::string& directory) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::vector<fs::path> paths;
  fs::directory_iterator entry(directory, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    const std::string name = entry->path().filename().string();
    const bool plain =
        name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-") ==
        std::string::npos;
    if (plain && name.front() != '.' && fs::is_regular_file(entry->symlink_status(ignored)))
      paths.push_back(entry->path());
  }
  if (error)
    return fail(Fault::not_found, "http.web_directory", "cannot read " + directory + ": " + error.message());
  std::sort(paths.begin(), paths.end());
  std::vector<Endpoint> endpoints;
  for (const fs::path& path : paths) {
    Result<std::string> bytes = read_text_file(path, std::string::npos);
    if (!bytes) return fail(Fault::not_found, "http.web_directory", "cannot read " + path.string());
    add_endpoints(endpoints, path.filename().string(), std::move(*bytes));
  }
  return endpoints;
}

}  // namespace joulecast::http
