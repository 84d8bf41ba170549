#include "abbe/notify/transfer.hpp"

#include <curl/curl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <optional>
#include <string_view>

#include "abbe/protocol/printable.hpp"

namespace abbe::notify {
namespace {

using Kind = TransferOutcome::Kind;

constexpr std::size_t kLongestAnswer = 64u << 10, kShownOfAnswer = 200;

struct CurlLibrary {
  CurlLibrary() { ::curl_global_init(CURL_GLOBAL_DEFAULT); }
  CurlLibrary(const CurlLibrary&) = delete;
  CurlLibrary& operator=(const CurlLibrary&) = delete;
  ~CurlLibrary() { ::curl_global_cleanup(); }
};

using Easy = std::unique_ptr<CURL, decltype(&::curl_easy_cleanup)>;
using List = std::unique_ptr<curl_slist, decltype(&::curl_slist_free_all)>;

template <class Value>
void set(CURL* easy, CURLoption option, Value value) {
  ::curl_easy_setopt(easy, option, value);
}

void append(List& list, const std::string& line) {
  if (auto* const longer = ::curl_slist_append(list.get(), line.c_str()); longer != nullptr) {
    (void)list.release();
    list.reset(longer);
  }
}

/// The data sent and received in one attempt; libcurl keeps pointers to its members.
struct Exchange {
  std::string out;
  std::size_t sent = 0;
  std::string answer;
  bool answer_too_long = false;
  std::array<char, CURL_ERROR_SIZE> fault{};
  List headers{nullptr, &::curl_slist_free_all}, recipients{nullptr, &::curl_slist_free_all};
};

std::size_t read_mail(char* to, std::size_t size, std::size_t count, void* exchange) {
  auto& e = *static_cast<Exchange*>(exchange);
  const std::size_t n = std::min(size * count, e.out.size() - e.sent);
  std::memcpy(to, e.out.data() + e.sent, n);
  e.sent += n;
  return n;
}

std::size_t keep_answer(char* bytes, std::size_t size, std::size_t count, void* exchange) {
  auto& e = *static_cast<Exchange*>(exchange);
  e.answer.append(bytes, size * count);
  e.answer_too_long = e.answer.size() > kLongestAnswer;
  return e.answer_too_long ? 0 : size * count;
}

void set_common(CURL* easy, Exchange& exchange, const Receiver& receiver,
                const TransferLimits& limits) {
  set(easy, CURLOPT_ERRORBUFFER, exchange.fault.data());
  set(easy, CURLOPT_NOSIGNAL, 1L);
  // at the end, libcurl does not wait for a name service that hangs
  set(easy, CURLOPT_QUICK_EXIT, 1L);
  set(easy, CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(limits.connect.count()));
  set(easy, CURLOPT_TIMEOUT_MS, static_cast<long>(limits.whole.count()));
  set(easy, CURLOPT_FRESH_CONNECT, 1L);
  set(easy, CURLOPT_FORBID_REUSE, 1L);
  set(easy, CURLOPT_FOLLOWLOCATION, 0L);

  set(easy, CURLOPT_SSL_VERIFYPEER, 1L);
  constexpr long kNameMustMatch = 2;
  set(easy, CURLOPT_SSL_VERIFYHOST, kNameMustMatch);
  set(easy, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
  // The folder of the certificates of the computer (CURLOPT_CAPATH) remains.
  if (!receiver.ca_file.empty()) set(easy, CURLOPT_CAINFO, receiver.ca_file.c_str());

  set(easy, CURLOPT_WRITEFUNCTION, &keep_answer);
  set(easy, CURLOPT_WRITEDATA, static_cast<void*>(&exchange));
}

void set_way(CURL* easy, Exchange& exchange, const Webhook& webhook) {
  set(easy, CURLOPT_PROTOCOLS_STR, "http,https");
  set(easy, CURLOPT_URL, webhook.url.c_str());
  append(exchange.headers, "Content-Type: application/json");
  append(exchange.headers, "User-Agent: abbe-notify");
  if (!webhook.header.empty()) append(exchange.headers, webhook.header);
  set(easy, CURLOPT_HTTPHEADER, exchange.headers.get());
  set(easy, CURLOPT_POST, 1L);
  set(easy, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(exchange.out.size()));
  set(easy, CURLOPT_POSTFIELDS, exchange.out.c_str());
}

void set_way(CURL* easy, Exchange& exchange, const Mailbox& mailbox) {
  set(easy, CURLOPT_PROTOCOLS_STR, "smtp,smtps");
  set(easy, CURLOPT_URL, mailbox.server.c_str());
  set(easy, CURLOPT_USE_SSL,
      static_cast<long>(mailbox.starttls ? CURLUSESSL_ALL : CURLUSESSL_NONE));
  if (!mailbox.user.empty()) {
    set(easy, CURLOPT_USERNAME, mailbox.user.c_str());
    set(easy, CURLOPT_PASSWORD, mailbox.password.c_str());
  }

  set(easy, CURLOPT_MAIL_FROM, mailbox.from.c_str());
  append(exchange.recipients, mailbox.recipient);
  set(easy, CURLOPT_MAIL_RCPT, exchange.recipients.get());
  set(easy, CURLOPT_UPLOAD, 1L);
  set(easy, CURLOPT_READFUNCTION, &read_mail);
  set(easy, CURLOPT_READDATA, static_cast<void*>(&exchange));
}

std::string content_for(const Receiver& receiver, const Notification& notification,
                        std::uint64_t not_delivered) {
  if (const auto* const mailbox = std::get_if<Mailbox>(&receiver.way))
    return mail_of(notification, not_delivered,
                   {.from = mailbox->from, .to = mailbox->all_recipients});
  return json_of(notification, not_delivered);
}

long response_code(CURL* easy) {
  long code = 0;
  ::curl_easy_getinfo(easy, CURLINFO_RESPONSE_CODE, &code);
  return code;
}

std::string shown(const std::string& answer) {
  const auto text = protocol::printable_line(answer.substr(0, kShownOfAnswer));
  return text.empty() ? "" : fmt::format(": {}", text);
}

/// The fault that libcurl reports; its own text names host, certificate or time.
std::string text_of_fault(CURLcode code, const Exchange& exchange) {
  const std::string_view detail{exchange.fault.data()};
  return protocol::printable_line(detail.empty() ? ::curl_easy_strerror(code) : detail);
}

TransferOutcome http_outcome(CURL* easy, CURLcode code, const Exchange& exchange) {
  const long http = response_code(easy);
  const bool answered = code == CURLE_OK || (exchange.answer_too_long && http > 0);
  if (!answered) return {Kind::Failed, text_of_fault(code, exchange)};

  // RFC 9110, 15: 2xx is success, 3xx redirection, 4xx an error of the client.
  if (http >= 200 && http < 300) return {Kind::Accepted, fmt::format("HTTP {}", http)};
  if (http >= 300 && http < 400)
    return {Kind::Refused, fmt::format("HTTP {}: a redirect is not followed; enter the address of "
                                       "the receiver itself",
                                       http)};
  constexpr long kTimeout = 408, kTooEarly = 425, kTooMany = 429;
  const bool later = http >= 500 || http == kTimeout || http == kTooEarly || http == kTooMany;
  return {later ? Kind::Failed : Kind::Refused,
          fmt::format("HTTP {}{}", http, shown(exchange.answer))};
}

TransferOutcome mail_outcome(CURL* easy, CURLcode code, const Exchange& exchange) {
  const long smtp = response_code(easy);
  if (code == CURLE_OK) return {Kind::Accepted, fmt::format("SMTP {}", smtp)};
  // RFC 5321, 4.2.1: a 5xx reply is permanent, a 4xx reply transient.
  const bool for_good = smtp >= 500 && smtp < 600;
  return {for_good ? Kind::Refused : Kind::Failed,
          fmt::format("{}{}", text_of_fault(code, exchange),
                      smtp >= 400 ? fmt::format(" (SMTP {})", smtp) : "")};
}

}  // namespace

struct Transfer::Multi {
  CURLM* handle = nullptr;
  Multi() {
    static const CurlLibrary library;
    handle = ::curl_multi_init();
  }
  Multi(const Multi&) = delete;
  Multi& operator=(const Multi&) = delete;
  ~Multi() { ::curl_multi_cleanup(handle); }

  /// The result of libcurl; nullopt: stop() was called.
  std::optional<CURLcode> run(CURL* easy, const std::atomic<bool>& stopping) const {
    constexpr int kLongestWait_ms = 1000;
    ::curl_multi_add_handle(handle, easy);
    int running = 1;
    while (running > 0 && !stopping) {
      if (::curl_multi_perform(handle, &running) != CURLM_OK) break;
      if (running > 0) ::curl_multi_poll(handle, nullptr, 0, kLongestWait_ms, nullptr);
    }

    std::optional<CURLcode> result;
    int left = 0;
    while (const CURLMsg* const message = ::curl_multi_info_read(handle, &left))
      if (message->msg == CURLMSG_DONE) result = message->data.result;
    ::curl_multi_remove_handle(handle, easy);
    return result;
  }
};

Transfer::Transfer(TransferLimits limits) : limits_(limits), multi_(std::make_unique<Multi>()) {}

Transfer::~Transfer() = default;

void Transfer::stop() {
  stopping_ = true;
  ::curl_multi_wakeup(multi_->handle);
}

TransferOutcome Transfer::send(const Receiver& receiver, const Notification& notification,
                               std::uint64_t not_delivered) {
  Exchange exchange;  // declared first, because the destruction of `easy` may use it
  const Easy easy{::curl_easy_init(), &::curl_easy_cleanup};
  if (!easy || multi_->handle == nullptr) return {Kind::Failed, "libcurl cannot be used"};

  exchange.out = content_for(receiver, notification, not_delivered);
  set_common(easy.get(), exchange, receiver, limits_);
  std::visit([&](const auto& way) { set_way(easy.get(), exchange, way); }, receiver.way);
  const auto code = multi_->run(easy.get(), stopping_);
  if (!code) return {Kind::Failed, "stopped"};

  return std::holds_alternative<Webhook>(receiver.way) ? http_outcome(easy.get(), *code, exchange)
                                                       : mail_outcome(easy.get(), *code, exchange);
}

}  // namespace abbe::notify
