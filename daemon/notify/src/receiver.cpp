#include "abbe/notify/receiver.hpp"

#include <fmt/format.h>

#include <cstddef>

#include "abbe/base/secret_file.hpp"
#include "abbe/result/try.hpp"

namespace abbe::notify {
namespace {

using daemon::ErrorCode;
using daemon::NotifyMail;
using daemon::NotifyWebhook;
using daemon::Result;

Result<std::string> url_of(const NotifyWebhook& webhook) {
  if (webhook.url_file.empty()) return webhook.url;
  auto url = daemon::read_secret(webhook.url_file);
  ABBE_TRY(url);
  const auto fault = daemon::webhook_url_fault(*url, !webhook.token_file.empty());
  if (fault.empty()) return url;
  return daemon::fail(ErrorCode::BadInput, fmt::format("{}: {}", webhook.url_file.string(), fault));
}

Result<Receiver> receiver_of(const NotifyWebhook& webhook, std::size_t number) {
  const auto url = url_of(webhook);
  ABBE_TRY(url);
  Webhook way{.url = *url, .header = {}};
  if (!webhook.token_file.empty()) {
    const auto token = daemon::read_secret(webhook.token_file);
    ABBE_TRY(token);
    way.header = fmt::format("{}: {}", webhook.header, *token);
  }
  return Receiver{.name = fmt::format("webhook {} ({})", number, daemon::scheme_and_host(*url)),
                  .way = std::move(way),
                  .ca_file = {}};
}

Receiver receiver_of(const NotifyMail& mail, const std::string& password,
                     const std::string& recipient) {
  return {.name = fmt::format("mail to {} ({})", recipient, mail.server),
          .way = Mailbox{.server = mail.server,
                         .starttls = mail.starttls,
                         .user = mail.user,
                         .password = password,
                         .from = mail.from,
                         .recipient = recipient,
                         .all_recipients = mail.to},
          .ca_file = {}};
}

}  // namespace

Result<std::vector<Receiver>> receivers_of(const daemon::NotifyConfig& config) {
  std::vector<Receiver> out;
  for (const NotifyWebhook& webhook : config.webhooks) {
    auto receiver = receiver_of(webhook, out.size() + 1);
    ABBE_TRY(receiver);
    out.push_back(std::move(*receiver));
  }

  std::string password;
  if (!config.mail.password_file.empty()) {
    const auto secret = daemon::read_secret(config.mail.password_file);
    ABBE_TRY(secret);
    password = *secret;
  }
  for (const std::string& recipient : config.mail.to)
    out.push_back(receiver_of(config.mail, password, recipient));

  for (Receiver& receiver : out) receiver.ca_file = config.ca_file;
  if (out.empty())
    return daemon::fail(ErrorCode::BadInput,
                        "[notify] has no receiver: add [[notify.webhook]] or [notify.mail]");
  return out;
}

}  // namespace abbe::notify
