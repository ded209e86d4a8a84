#include "server/http/static_files.h"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <utility>

#include "server/http/text.h"

namespace joulecast::http {
namespace {

constexpr const char* content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

struct Asset {
  std::string content_type;
  std::string cache_control;
  std::shared_ptr<const std::string> plain;
  std::shared_ptr<const std::string> gzipped;  // null where gzip does not pay
  std::string plain_tag;
  std::string gzipped_tag;
};

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
  for (const auto& [ending, type] : types) {
    if (name.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

// FNV-1a, 64 bits: tells versions of a file apart; nothing here relies on it against an adversary.
std::string content_hash(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  char text[20];
  const auto [end, code] = std::to_chars(text, text + sizeof text, hash, 16);
  (void)code;  // 16 hexadecimal digits at most
  return std::string(text, end);
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

bool lists(std::string_view header, std::string_view wanted) {
  while (!header.empty()) {
    const auto comma = header.find(',');
    std::string_view item = trim(header.substr(0, comma));
    header.remove_prefix(comma == std::string_view::npos ? header.size() : comma + 1);
    const auto semicolon = item.find(';');
    const bool refused = semicolon != std::string_view::npos &&
                         item.substr(semicolon).find("q=0") != std::string_view::npos &&
                         item.substr(semicolon).find_first_of("123456789") == std::string_view::npos;
    item = trim(item.substr(0, semicolon));
    if (item.starts_with("W/")) item.remove_prefix(2);
    if (!refused && (item == "*" || equals_ignoring_case(item, wanted))) return true;
  }
  return false;
}

Response serve(const Asset& asset, const Request& request) {
  const bool compressed = asset.gzipped && lists(request.header("accept-encoding"), "gzip");
  const std::string& tag = compressed ? asset.gzipped_tag : asset.plain_tag;
  Response response;
  response.content_type = asset.content_type;
  response.headers = {{"ETag", tag},
                      {"Cache-Control", asset.cache_control},
                      {"Vary", "Accept-Encoding"},
                      {"Content-Security-Policy", content_security_policy},
                      {"Referrer-Policy", "no-referrer"}};
  if (lists(request.header("if-none-match"), tag)) {
    response.status = 304;
    return response;
  }
  if (compressed) response.headers.emplace_back("Content-Encoding", "gzip");
  response.shared_body = compressed ? asset.gzipped : asset.plain;
  return response;
}

void add_endpoints(std::vector<Endpoint>& endpoints, std::string_view name, std::string bytes) {
  const auto asset = std::make_shared<Asset>();
  const std::string hash = content_hash(bytes);
  asset->content_type = content_type_of(name);
  asset->cache_control = has_hash_in_name(name) ? "public, max-age=31536000, immutable" : "no-cache";
  asset->plain_tag = "\"" + hash + "\"";
  asset->gzipped_tag = "\"" + hash + "-gzip\"";
  std::string small = gzip(bytes);
  if (!small.empty() && small.size() < bytes.size())
    asset->gzipped = std::make_shared<const std::string>(std::move(small));
  asset->plain = std::make_shared<const std::string>(std::move(bytes));

  Endpoint endpoint;
  endpoint.path = "/" + std::string(name);
  endpoint.operation_id = "getAsset";
  endpoint.role = Role::open;
  endpoint.summary = "File of the operator page";
  endpoint.response_type = asset->content_type;
  endpoint.run = Run::io;
  endpoint.documented = false;
  endpoint.handler = [asset](const Request& request) -> Result<Response> { return serve(*asset, request); };
  endpoints.push_back(endpoint);
  if (name == "index.html") {
    endpoint.path = "/";
    endpoint.operation_id = "getOperatorPage";
    endpoint.summary = "The operator page";
    endpoint.documented = true;
    endpoints.push_back(std::move(endpoint));
  }
}

}  // namespace

std::string gzip(std::string_view bytes) {
  z_stream stream{};
  constexpr int gzip_window = 15 + 16;
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, gzip_window, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    return {};
  std::string packed(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // zlib only reads it
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int code = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return code == Z_STREAM_END ? packed : std::string();
}

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
    std::ifstream file(path, std::ios::binary);
    std::ostringstream bytes;
    if (fs::file_size(path, error) > 0 && (!file || !(bytes << file.rdbuf()))) {
      return fail(Fault::not_found, "http.web_directory", "cannot read " + path.string());
    }
    add_endpoints(endpoints, path.filename().string(), std::move(bytes).str());
  }
  return endpoints;
}

}  // namespace joulecast::http
