#include "protected_structure.hpp"

#include "rtps_fields.hpp"

namespace abbe::dds {
namespace {

using namespace rtps_message;

/// Sizes. CryptoHeader: kind, key id, session id, suffix of the initialisation vector.
/// CryptoFooter: MAC, and number of the receivers' MACs, each with its key id.
constexpr std::size_t kCryptoHeaderBytes = 20, kCryptoFooterBytes = 20, kReceiverMacBytes = 20;

/// A number of DDS Security. It is big-endian, whatever the byte order of the submessage.
std::uint32_t number_at(std::span<const std::uint8_t> body, std::size_t at) {
  return FieldReader(body, false).u32(at);
}

bool is_crypto_footer(std::span<const std::uint8_t> body) {
  constexpr std::size_t kMacCountAt = 16;
  return body.size() >= kCryptoFooterBytes &&
         (body.size() - kCryptoFooterBytes) / kReceiverMacBytes == number_at(body, kMacCountAt) &&
         (body.size() - kCryptoFooterBytes) % kReceiverMacBytes == 0;
}

/// True if the body consists of encrypted octets after their number.
bool is_secure_body(std::span<const std::uint8_t> body) {
  constexpr std::size_t kCountBytes = 4;
  return body.size() >= kCountBytes && number_at(body, 0) <= body.size() - kCountBytes;
}

}  // namespace

std::optional<bool> ProtectedStructure::next(std::uint8_t kind, std::span<const std::uint8_t> body,
                                             bool first, bool open) {
  if (first && kind == kSecureMessagePrefix) message_ = Message::Signed;
  const bool in_message = message_ == Message::Signed;
  if (message_ == Message::Ended) return std::nullopt;
  if (open && (in_message || submessage_ != Submessage::None)) return std::nullopt;

  switch (kind) {
    case kSecureMessagePrefix:
      if (!first || body.size() < kCryptoHeaderBytes) return std::nullopt;
      return true;
    case kSecureMessagePostfix:
      if (!in_message || submessage_ != Submessage::None || !is_crypto_footer(body))
        return std::nullopt;
      message_ = Message::Ended;
      return true;
    case kSecurePrefix:
      if (submessage_ != Submessage::None || body.size() < kCryptoHeaderBytes) return std::nullopt;
      submessage_ = Submessage::Begun;
      return true;
    case kSecurePostfix:
      if (submessage_ != Submessage::HasContent || !is_crypto_footer(body)) return std::nullopt;
      submessage_ = Submessage::None;
      return true;
    case kSecureBody:
      if (!is_secure_body(body) || (submessage_ == Submessage::None && !in_message))
        return std::nullopt;
      break;
    default:
      break;
  }
  if (submessage_ == Submessage::HasContent) return std::nullopt;
  if (submessage_ == Submessage::None) return in_message;
  submessage_ = Submessage::HasContent;
  return true;
}

bool ProtectedStructure::is_complete() const {
  return message_ != Message::Signed && submessage_ == Submessage::None;
}

}  // namespace abbe::dds
