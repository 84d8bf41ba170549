#include "notify_url.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>

#include "abbe/config/notify_config.hpp"

namespace abbe::daemon {
namespace {

constexpr std::size_t kLongestUrl = 2000;

bool is_visible_ascii(char c) {
  return c > ' ' && c < 0x7F;
}

bool is_port(std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc{} && end == text.data() + text.size() && port > 0;
}

bool is_host_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '-' || c == '_';
}

bool is_host(std::string_view host) {
  if (host.size() > 2 && host.front() == '[' && host.back() == ']')
    return std::ranges::all_of(host.substr(1, host.size() - 2), [](char c) {
      return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F') ||
             c == ':' || c == '.';
    });
  return !host.empty() && std::ranges::all_of(host, is_host_character);
}

/// The index of the colon before the port; npos: there is no port.
std::size_t colon_of_port(std::string_view authority) {
  const auto colon = authority.rfind(':');
  const auto bracket = authority.rfind(']');
  return bracket != authority.npos && colon != authority.npos && colon < bracket ? authority.npos
                                                                                 : colon;
}

}  // namespace

std::optional<NotifyUrl> notify_url(std::string_view url) {
  const auto scheme_end = url.find("://");
  if (scheme_end == url.npos || url.size() > kLongestUrl ||
      !std::ranges::all_of(url, is_visible_ascii))
    return std::nullopt;

  const std::string_view rest = url.substr(scheme_end + 3);
  const auto path_begin = std::min(rest.find_first_of("/?#"), rest.size());
  const std::string_view authority = rest.substr(0, path_begin);
  const auto colon = colon_of_port(authority);
  const NotifyUrl parts{.scheme = url.substr(0, scheme_end),
                        .authority = authority,
                        .host = authority.substr(0, std::min(colon, authority.size())),
                        .path = rest.substr(path_begin)};

  if (authority.find('@') != authority.npos) return parts;  // the caller refuses such a text
  if (!is_host(parts.host)) return std::nullopt;
  if (colon != authority.npos && !is_port(authority.substr(colon + 1))) return std::nullopt;
  return parts;
}

bool NotifyUrl::has_user() const {
  return authority.find('@') != authority.npos;
}

bool NotifyUrl::stays_on_this_computer() const {
  return host == "localhost" || host == "127.0.0.1" || host == "[::1]";
}

std::string webhook_url_fault(std::string_view url, bool with_token) {
  const auto parts = notify_url(url);
  if (!parts || (parts->scheme != "https" && parts->scheme != "http"))
    return "must be a URL that begins with https:// or http://";
  if (parts->has_user())
    return "contains a user or a password: write the value of the header Authorization into "
           "token_file";
  if (with_token && parts->scheme == "http" && !parts->stays_on_this_computer())
    return "the token would be readable on the network: https:// is required with token_file";
  return {};
}

std::string mail_server_fault(const NotifyMail& mail) {
  const auto parts = notify_url(mail.server);
  if (!parts || (parts->scheme != "smtps" && parts->scheme != "smtp"))
    return "must be smtps://HOST or smtp://HOST, with :PORT if it is not the usual one";
  if (parts->has_user()) return "contains a user or a password: use user and password_file";
  if (!parts->path.empty() && parts->path != "/") return "must end after the host or its port";
  const bool encrypted = parts->scheme == "smtps" || mail.starttls;
  if (!mail.user.empty() && !encrypted && !parts->stays_on_this_computer())
    return "the password would be readable on the network: with user, smtps:// or starttls = true "
           "is required";
  return {};
}

std::string scheme_and_host(std::string_view url) {
  const auto parts = notify_url(url);
  return parts && !parts->has_user() ? fmt::format("{}://{}", parts->scheme, parts->authority)
                                     : std::string{"a URL that cannot be used"};
}

}  // namespace abbe::daemon
