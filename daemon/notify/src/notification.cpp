#include "abbe/notify/notification.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <ctime>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/local_time.hpp"
#include "abbe/base/utc_text.hpp"
#include "base64.hpp"

namespace abbe::notify {
namespace {

using nlohmann::json;

constexpr int kSchema = 1;
constexpr std::size_t kLongestLine = 4000, kLongestSubject = 200;
constexpr std::string_view kLineEnd = "\r\n";

bool continues_character(char c) {
  return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
}

/// The beginning of `text`, at most `most` bytes, cut between two characters of UTF-8.
std::string_view shortened(std::string_view text, std::size_t most) {
  if (text.size() <= most) return text;
  std::size_t end = most;
  while (end > 0 && continues_character(text[end])) --end;
  return text.substr(0, end);
}

/// The text on one line: control characters become spaces.
std::string one_line(std::string_view text, std::size_t most) {
  std::string out{shortened(text, most)};
  std::ranges::replace_if(
      out, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }, ' ');
  return out;
}

std::string upper_case(std::string_view word) {
  std::string out{word};
  std::ranges::transform(out, out.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return out;
}

std::string lost_text(std::uint64_t not_delivered) {
  return not_delivered == 1 ? "1 notification was not delivered"
                            : fmt::format("{} notifications were not delivered", not_delivered);
}

/// The date as in [RFC 5322, 3.3]: "Fri, 17 May 2024 08:30:00 +0000". strftime() is not used,
/// because it would use the words of a locale.
std::string mail_date(protocol::UtcTime time) {
  constexpr std::array kDays{"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr std::array kMonths{"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                               "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  const std::time_t seconds =
      std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
  std::tm utc{};
  ::gmtime_r(&seconds, &utc);
  constexpr int kFirstYear = 1900;
  return fmt::format("{}, {:02} {} {} {:02}:{:02}:{:02} +0000",
                     kDays.at(static_cast<std::size_t>(utc.tm_wday)), utc.tm_mday,
                     kMonths.at(static_cast<std::size_t>(utc.tm_mon)), utc.tm_year + kFirstYear,
                     utc.tm_hour, utc.tm_min, utc.tm_sec);
}

std::string body_text(const Notification& n, std::uint64_t not_delivered) {
  std::string out = headline(n, not_delivered) + "\n\n";
  const auto line = [&out](std::string_view name, const std::string& value) {
    if (!value.empty()) out += fmt::format("{:<10} {}\n", name, value);
  };
  line("machine", one_line(n.machine, kLongestLine));
  line("event", fmt::format("{}, {}", n.kind, name_of(n.phase)));
  line("severity", std::string{name_of(n.severity)});
  line("time", daemon::local_time_text(n.time));
  line("UTC", daemon::to_text(n.time));
  line("model", n.model_id);
  if (n.session > 0) line("session", fmt::format("{}", n.session));
  if (n.changes > 1) line("changes", fmt::format("{}", n.changes));
  if (n.simulated) line("devices", "SIMULATED");
  return out;
}

/// The text as Base64, in lines of 76 characters.
std::string base64_lines(std::string_view text) {
  constexpr std::size_t kWidth = 76;
  const std::string digits = base64(text);
  std::string out;
  for (std::size_t i = 0; i < digits.size(); i += kWidth)
    out += fmt::format("{}{}", std::string_view{digits}.substr(i, kWidth), kLineEnd);
  return out;
}

std::string host_of(const std::string& address) {
  return address.substr(address.find('@') + 1);
}

}  // namespace

std::string headline(const Notification& n, std::uint64_t not_delivered) {
  return one_line(
      fmt::format("{} {}: {}{}{}{}", upper_case(name_of(n.severity)), n.machine,
                  n.simulated ? "SIMULATED devices: " : "", n.text,
                  n.changes > 1 ? fmt::format("; {} changes", n.changes) : "",
                  not_delivered > 0 ? fmt::format("; {}", lost_text(not_delivered)) : ""),
      kLongestLine);
}

std::string json_of(const Notification& n, std::uint64_t not_delivered) {
  json out{{"schema", kSchema},
           {"id", n.id},
           {"text", headline(n, not_delivered)},
           {"machine", n.machine},
           {"event", n.kind},
           {"phase", name_of(n.phase)},
           {"severity", name_of(n.severity)},
           {"time", daemon::to_text(n.time)},
           {"local_time", daemon::local_time_text(n.time)},
           {"message", one_line(n.text, kLongestLine)},
           {"subjects", n.subjects},
           {"changes", n.changes},
           {"simulated", n.simulated},
           {"not_delivered", not_delivered}};
  if (!n.model_id.empty()) out["model_id"] = n.model_id;
  if (n.session > 0) out["session"] = n.session;
  return daemon::json_text(out);
}

std::string header_text(std::string_view text) {
  constexpr std::size_t kLongestPlain = 60;
  // 45 bytes give 60 Base64 digits; with "=?UTF-8?B?" and "?=" these are 72 characters. Lines have
  // at most 76 characters. The first line also contains the name of the header.
  constexpr std::size_t kBytesOfFirstWord = 36, kBytesOfWord = 45;
  const std::string line = one_line(text, kLongestSubject);
  const bool is_plain = line.size() <= kLongestPlain && line.find("=?") == line.npos &&
                        std::ranges::all_of(line, [](char c) { return c >= ' ' && c < 0x7F; });
  if (is_plain) return line;

  std::string out;
  for (std::string_view rest = line; !rest.empty();) {
    const std::size_t most = out.empty() ? kBytesOfFirstWord : kBytesOfWord;
    std::string_view word = shortened(rest, most);
    if (word.empty()) word = rest.substr(0, most);  // the text is not UTF-8: cut at any byte
    out += fmt::format("{}=?UTF-8?B?{}?=", out.empty() ? "" : "\r\n ", base64(word));
    rest.remove_prefix(word.size());
  }
  return out;
}

std::string mail_of(const Notification& n, std::uint64_t not_delivered,
                    const MailAddresses& addresses) {
  std::string out;
  const auto header = [&out](std::string_view name, std::string_view value) {
    out += fmt::format("{}: {}{}", name, value, kLineEnd);
  };
  header("Date", mail_date(n.time));
  header("From", addresses.from);
  header("To", fmt::format("{}", fmt::join(addresses.to, ",\r\n ")));
  header("Subject", header_text(headline(n, 0)));
  header("Message-ID", fmt::format("<{}@{}>", n.id, host_of(addresses.from)));
  header("Auto-Submitted", "auto-generated");
  header("MIME-Version", "1.0");
  header("Content-Type", "text/plain; charset=utf-8");
  header("Content-Transfer-Encoding", "base64");
  out += kLineEnd;
  return out + base64_lines(body_text(n, not_delivered));
}

}  // namespace abbe::notify
