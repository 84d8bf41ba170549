#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "abbe/base/secret_file.hpp"
#include "abbe/config/notify_config.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "notify_url.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

constexpr std::size_t kMostWebhooks = 8, kMostRecipients = 16, kLongestAddress = 254;

std::vector<NotifyKind> every_kind() {
  std::vector<NotifyKind> all;
  for (std::size_t i = 0; i < kNotifyKindNames.size(); ++i)
    all.push_back(static_cast<NotifyKind>(i));
  return all;
}

void read_events(Section& section, std::vector<NotifyKind>& out) {
  std::vector<std::string> words;
  if (!section.get("events", words)) return;

  out.clear();
  for (const std::string& word : words) {
    const auto* const found = std::ranges::find(kNotifyKindNames, word);
    if (found == kNotifyKindNames.end())
      section.fault("events", fmt::format("\"{}\": must be one of {}", word,
                                          fmt::join(kNotifyKindNames, ", ")));
    else
      out.push_back(static_cast<NotifyKind>(found - kNotifyKindNames.begin()));
  }
}

/// True if `name` can be the name of an HTTP header: RFC 9110, 5.6.2.
bool is_header_name(const std::string& name) {
  static constexpr std::string_view kOther = "!#$%&'*+-.^_`|~";
  return !name.empty() && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           kOther.find(c) != kOther.npos;
  });
}

/// True for a header that libcurl writes itself. A second header of this name would be ambiguous.
bool is_written_anyway(std::string name) {
  std::ranges::transform(name, name.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return name == "host" || name == "content-length" || name == "content-type" ||
         name == "transfer-encoding" || name == "connection";
}

NotifyWebhook read_webhook(Section& section, const std::filesystem::path& base) {
  NotifyWebhook out;
  const bool has_url = section.get("url", out.url);
  const bool has_file = section.get("url_file", out.url_file, base);
  const bool has_header = section.get("header", out.header);
  const bool has_token = section.get("token_file", out.token_file, base);

  if (section.has("url") == section.has("url_file"))
    section.fault(has_file ? "url_file" : "url", "either url or url_file is required, not both");
  if (has_url)
    if (const auto fault = webhook_url_fault(out.url, has_token); !fault.empty())
      section.fault("url", fault);
  if (has_header && !has_token)
    section.fault("header", "its value is missing: token_file names the file that contains it");
  if (!is_header_name(out.header) || is_written_anyway(out.header))
    section.fault("header", fmt::format("\"{}\": must be the name of a header of HTTP, for example "
                                        "Authorization",
                                        out.header));
  section.close();
  return out;
}

/// True for NAME@HOST in printable ASCII. Such an address can end neither an SMTP command nor a
/// header.
bool is_mail_address(const std::string& address) {
  static constexpr std::string_view kForbidden = "<>()[]\\,;:\"";
  const auto at = address.find('@');
  return address.size() <= kLongestAddress && at != address.npos && at > 0 &&
         at + 1 < address.size() && address.find('@', at + 1) == address.npos &&
         std::ranges::all_of(address, [](char c) {
           return c > ' ' && c < 0x7F && kForbidden.find(c) == kForbidden.npos;
         });
}

void check_addresses(Section& section, const NotifyMail& mail) {
  constexpr std::string_view kWhat = "must be an address such as abbe@example.com";
  if (!mail.from.empty() && !is_mail_address(mail.from))
    section.fault("from", fmt::format("\"{}\": {}", mail.from, kWhat));
  for (const std::string& to : mail.to)
    if (!is_mail_address(to)) section.fault("to", fmt::format("\"{}\": {}", to, kWhat));
  if (mail.to.empty() || mail.to.size() > kMostRecipients)
    section.fault("to", fmt::format("must be 1 to {} addresses", kMostRecipients));
}

NotifyMail read_mail(Section section, const std::filesystem::path& base) {
  NotifyMail out;
  if (!section.present()) return out;
  const bool has_server = section.get("server", out.server, Need::Required);
  section.get("starttls", out.starttls);
  section.get("from", out.from, Need::Required);
  section.get("to", out.to);
  section.get("user", out.user);
  section.get("password_file", out.password_file, base);

  if (out.user.empty() != out.password_file.empty())
    section.fault(out.user.empty() ? "password_file" : "user",
                  "user and password_file are needed together");
  if (has_server)
    if (const auto fault = mail_server_fault(out); !fault.empty()) section.fault("server", fault);
  check_addresses(section, out);
  section.close();
  return out;
}

/// Adds a fault if a file is missing or if other users may read it. A file in a folder that this
/// user may not search is not checked, because abbe-notify may be able to read it.
void check_secret(Section& section, std::string_view key, const std::filesystem::path& file) {
  std::error_code error;
  (void)std::filesystem::status(file, error);
  if (file.empty() || error == std::errc::permission_denied) return;
  if (const auto usable = check_secret_mode(file); !usable) section.fault(key, usable.error().text);
}

}  // namespace

NotifyConfig::NotifyConfig() : events(every_kind()) {}

NotifyConfig read_notify(Section section, const std::filesystem::path& base) {
  NotifyConfig out;
  read_events(section, out.events);
  section.get("settle_s", out.settle, kPlain, {0.0, 600.0});
  section.get("ca_file", out.ca_file, base);
  for (Section& webhook : section.children("webhook"))
    out.webhooks.push_back(read_webhook(webhook, base));
  if (out.webhooks.size() > kMostWebhooks)
    section.fault("webhook", fmt::format("there may be at most {}", kMostWebhooks));
  out.mail = read_mail(section.child("mail"), base);
  section.close();
  return out;
}

void check_notify_files(Section section, const NotifyConfig& config) {
  std::error_code error;
  if (!config.ca_file.empty() && !std::filesystem::is_regular_file(config.ca_file, error) &&
      error != std::errc::permission_denied)
    section.fault("ca_file", fmt::format("there is no file {}", config.ca_file.string()));

  auto webhooks = section.children("webhook");
  for (std::size_t i = 0; i < std::min(webhooks.size(), config.webhooks.size()); ++i) {
    check_secret(webhooks[i], "url_file", config.webhooks[i].url_file);
    check_secret(webhooks[i], "token_file", config.webhooks[i].token_file);
  }
  Section mail = section.child("mail");
  check_secret(mail, "password_file", config.mail.password_file);
}

Result<NotifySettings> load_notify_settings(const std::filesystem::path& file) {
  const auto text = read_configuration_text(file);
  ABBE_TRY(text);
  const auto table = parse_toml(*text, file.string());
  ABBE_TRY(table);

  Faults faults(file.string(), kMostConfigFaults);
  Section root(&*table, "", {1, 1}, faults);
  const Config config = read_all(root, file.parent_path());
  if (faults.any()) return tl::make_unexpected(faults.to_error());

  const NotifySettings settings{.control_socket = config.control.socket,
                                .machine = config.machine.name,
                                .notify = read_notify(root.child("notify"), file.parent_path())};
  check_notify_files(root.child("notify"), settings.notify);
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return settings;
}

}  // namespace abbe::daemon
