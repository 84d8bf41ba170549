#include "abbe/base/sha256.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "abbe/base/input_file.hpp"

namespace abbe::daemon {

struct Sha256::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { EVP_MD_CTX_free(context); }
};

namespace {

std::string finish(EVP_MD_CTX* context) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_DigestFinal_ex(context, digest.data(), &size);
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(2 * size);
  for (const unsigned char byte : std::span{digest}.first(size)) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 0xf];
  }
  return text;
}

}  // namespace

Sha256::Sha256() : state_(std::make_unique<State>()) {
  // EVP_MD_CTX_new() and EVP_DigestInit_ex() fail only for lack of memory, because SHA-256 is part
  // of OpenSSL's default provider.
  if (state_->context == nullptr || EVP_DigestInit_ex(state_->context, EVP_sha256(), nullptr) != 1)
    throw std::bad_alloc();
}

Sha256::~Sha256() = default;

void Sha256::update(std::span<const std::byte> bytes) {
  EVP_DigestUpdate(state_->context, bytes.data(), bytes.size());
}

void Sha256::update(std::string_view text) {
  update(std::as_bytes(std::span{text}));
}

std::string Sha256::hex() {
  return finish(state_->context);
}

std::string Sha256::hex_so_far() const {
  State copy;
  EVP_MD_CTX_copy_ex(copy.context, state_->context);
  return finish(copy.context);
}

std::string sha256_hex(std::string_view text) {
  Sha256 hash;
  hash.update(text);
  return hash.hex();
}

Result<std::string> sha256_hex_of_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in)
    return fail(ErrorCode::Io, fmt::format("read {}: {}", file.string(), std::strerror(errno)));
  Sha256 hash;
  std::array<char, 1 << 16> buffer{};
  while (in.read(buffer.data(), buffer.size()) || in.gcount() > 0)
    hash.update(std::string_view{buffer.data(), static_cast<std::size_t>(in.gcount())});
  if (in.bad())
    return fail(ErrorCode::Io, fmt::format("read {}: {}", file.string(), std::strerror(errno)));
  return hash.hex();
}

Result<InputFile> hashed_file(const std::filesystem::path& file) {
  return sha256_hex_of_file(file).map([&](std::string hash) {
    return InputFile{file.filename().string(), std::move(hash)};
  });
}

}  // namespace abbe::daemon
