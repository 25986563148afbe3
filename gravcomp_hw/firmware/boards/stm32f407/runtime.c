// What the compiler calls for copies of structures (Run-time ABI for the Arm Architecture, section 4.3.4).
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *to, const void *from, size_t size);
void *memmove(void *to, const void *from, size_t size);
void *memset(void *memory, int value, size_t size);
void __aeabi_memcpy(void *to, const void *from, size_t size);
void __aeabi_memcpy4(void *to, const void *from, size_t size);
void __aeabi_memcpy8(void *to, const void *from, size_t size);
void __aeabi_memmove(void *to, const void *from, size_t size);
void __aeabi_memmove4(void *to, const void *from, size_t size);
void __aeabi_memmove8(void *to, const void *from, size_t size);
void __aeabi_memset(void *memory, size_t size, int value);
void __aeabi_memset4(void *memory, size_t size, int value);
void __aeabi_memset8(void *memory, size_t size, int value);
void __aeabi_memclr(void *memory, size_t size);
void __aeabi_memclr4(void *memory, size_t size);
void __aeabi_memclr8(void *memory, size_t size);

// The pointers are volatile where the compiler would make the loop a call of the function itself.
void *memcpy(void *to, const void *from, size_t size) {
  uint8_t *target = (uint8_t *)to;
  const uint8_t *source = (const uint8_t *)from;
  if ((((uintptr_t)to | (uintptr_t)from) & 3u) == 0u) {
    while (size >= 4u) {
      *(volatile uint32_t *)(void *)target = *(const uint32_t *)(const void *)source;
      target += 4;
      source += 4;
      size -= 4u;
    }
  }
  while (size > 0u) {
    *(volatile uint8_t *)target = *source;
    target++;
    source++;
    size--;
  }
  return to;
}

void *memmove(void *to, const void *from, size_t size) {
  uint8_t *target = (uint8_t *)to;
  const uint8_t *source = (const uint8_t *)from;
  if (target <= source) {
    return memcpy(to, from, size);
  }
  while (size > 0u) {
    size--;
    *(volatile uint8_t *)&target[size] = source[size];
  }
  return to;
}

void *memset(void *memory, int value, size_t size) {
  volatile uint8_t *target = (volatile uint8_t *)memory;
  for (size_t i = 0; i < size; i++) {
    target[i] = (uint8_t)value;
  }
  return memory;
}

void __aeabi_memcpy(void *to, const void *from, size_t size) { (void)memcpy(to, from, size); }
void __aeabi_memcpy4(void *to, const void *from, size_t size) { (void)memcpy(to, from, size); }
void __aeabi_memcpy8(void *to, const void *from, size_t size) { (void)memcpy(to, from, size); }
void __aeabi_memmove(void *to, const void *from, size_t size) { (void)memmove(to, from, size); }
void __aeabi_memmove4(void *to, const void *from, size_t size) { (void)memmove(to, from, size); }
void __aeabi_memmove8(void *to, const void *from, size_t size) { (void)memmove(to, from, size); }
void __aeabi_memset(void *memory, size_t size, int value) { (void)memset(memory, value, size); }
void __aeabi_memset4(void *memory, size_t size, int value) { (void)memset(memory, value, size); }
void __aeabi_memset8(void *memory, size_t size, int value) { (void)memset(memory, value, size); }
void __aeabi_memclr(void *memory, size_t size) { (void)memset(memory, 0, size); }
void __aeabi_memclr4(void *memory, size_t size) { (void)memset(memory, 0, size); }
void __aeabi_memclr8(void *memory, size_t size) { (void)memset(memory, 0, size); }
