#pragma once
/// Answers to a browser. All have a length, so that httplib neither copies nor compresses them.

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"

#include "http.hpp"

namespace abbe::web {

inline constexpr const char* kJson = "application/json";

/// Headers of every answer: nothing is loaded from elsewhere, no script or style is in the markup,
/// no other site may frame the page or read from it.
void add_security_headers(httplib::Response& response);

/// `bytes` must exist for the whole life of the server.
void send_asset(httplib::Response& response, std::string_view bytes, const char* type);
void send_text(httplib::Response& response, int status, std::string text, const char* type);
void send_json(httplib::Response& response, const nlohmann::json& value, int status = 200);
/// {"error": TEXT}; a status by the code of the error.
void send_error(httplib::Response& response, const daemon::Error& error);
void send_error(httplib::Response& response, int status, const std::string& text);
/// The text or the error.
void send_result(httplib::Response& response, daemon::Result<std::string> text,
                 const char* type = kJson);
void send_result(httplib::Response& response, const daemon::Result<nlohmann::json>& value);

}  // namespace abbe::web
