#include "responses.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "abbe/base/json_text.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;

constexpr const char* kContentPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'";

int status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::Usage:
    case ErrorCode::BadInput:
      return 400;
    case ErrorCode::Refused:
      return 409;
    case ErrorCode::DataInsufficient:
      return 422;
    case ErrorCode::Io:
    case ErrorCode::StopNotConfirmed:
    case ErrorCode::StopNotSent:
      return 503;
  }
  return 500;
}

/// Sends `length` bytes from `bytes`, which `owner` keeps alive.
void send_bytes(httplib::Response& response, std::string_view bytes, const char* type,
                const std::shared_ptr<const void>& owner) {
  if (bytes.empty()) {
    response.set_content(std::string{}, type);
    return;
  }
  response.set_content_provider(
      bytes.size(), type,
      [bytes, owner](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        if (offset > bytes.size()) return false;
        return sink.write(bytes.data() + offset, std::min(length, bytes.size() - offset));
      });
}

}  // namespace

void add_security_headers(httplib::Response& response) {
  response.set_header("Content-Security-Policy", kContentPolicy);
  response.set_header("X-Content-Type-Options", "nosniff");
  response.set_header("Referrer-Policy", "no-referrer");
  response.set_header("Cross-Origin-Opener-Policy", "same-origin");
  response.set_header("Cross-Origin-Resource-Policy", "same-origin");
  response.set_header("X-Frame-Options", "DENY");
  response.set_header("Cache-Control", "no-store");
}

void send_asset(httplib::Response& response, std::string_view bytes, const char* type) {
  send_bytes(response, bytes, type, nullptr);
}

void send_text(httplib::Response& response, int status, std::string text, const char* type) {
  response.status = status;
  const auto kept = std::make_shared<const std::string>(std::move(text));
  send_bytes(response, *kept, type, kept);
}

void send_json(httplib::Response& response, const nlohmann::json& value, int status) {
  send_text(response, status, daemon::json_text(value), kJson);
}

void send_error(httplib::Response& response, int status, const std::string& text) {
  send_json(response, {{"error", text}}, status);
}

void send_error(httplib::Response& response, const daemon::Error& error) {
  std::string text = error.text;
  for (const std::string& detail : error.details) text += "\n" + detail;
  send_error(response, status_of(error.code), text);
}

void send_result(httplib::Response& response, daemon::Result<std::string> text, const char* type) {
  if (!text) return send_error(response, text.error());
  send_text(response, 200, std::move(*text), type);
}

void send_result(httplib::Response& response, const daemon::Result<nlohmann::json>& value) {
  if (!value) return send_error(response, value.error());
  send_json(response, *value);
}

}  // namespace abbe::web
