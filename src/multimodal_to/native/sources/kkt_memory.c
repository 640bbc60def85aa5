/* Memory of the factorisation: an arena for what a structure needs, given back at once. */
#include "kkt.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { ALIGNMENT = 64 }; /* of a cache line, and of the longest vector */
enum { SMALL = 512, SMALL_ALIGNMENT = 16, CHUNK = 1 << 16 }; /* small pieces are cut from chunks [bytes] */

static void *own(KktArena *arena, void *block) {
  if (block && arena->count == arena->capacity) {
    int capacity = arena->capacity ? 2 * arena->capacity : 64;
    void **blocks = realloc(arena->blocks, sizeof(void *) * (size_t)capacity);
    if (!blocks) {
      free(block);
      block = NULL;
    } else {
      arena->blocks = blocks;
      arena->capacity = capacity;
    }
  }
  if (!block) longjmp(*arena->failure, KKT_NO_MEMORY);
  arena->blocks[arena->count++] = block;
  return block;
}

static char *aligned(void *block) { return (char *)block + (ALIGNMENT - (uintptr_t)block % ALIGNMENT); }

void *kkt_take(KktArena *arena, size_t count, size_t size) {
  if (size && count > (SIZE_MAX - 2 * ALIGNMENT) / size) longjmp(*arena->failure, KKT_NO_MEMORY);
  size_t bytes = count * size;
  if (bytes >= SMALL) return aligned(own(arena, calloc(1, bytes + ALIGNMENT)));
  bytes = (bytes + SMALL_ALIGNMENT) / SMALL_ALIGNMENT * SMALL_ALIGNMENT;
  if (bytes > arena->left) {
    arena->chunk = aligned(own(arena, calloc(1, CHUNK + ALIGNMENT)));
    arena->left = CHUNK;
  }
  char *piece = arena->chunk;
  arena->chunk += bytes;
  arena->left -= bytes;
  return piece;
}

void kkt_give_back(KktArena *arena) {
  for (int i = 0; i < arena->count; i++) free(arena->blocks[i]);
  free(arena->blocks);
  *arena = (KktArena){0};
}

int kkt_grow(KktBuffer *buffer, size_t count) {
  if (buffer->block && count <= buffer->capacity) return 1;
  kkt_release(buffer);
  size_t capacity = count + count / 8 + ALIGNMENT;
  buffer->block = malloc(sizeof(double) * capacity + ALIGNMENT);
  if (!buffer->block) return 0;
  buffer->capacity = capacity;
  buffer->values = (double *)((char *)buffer->block + (ALIGNMENT - (uintptr_t)buffer->block % ALIGNMENT));
  return 1;
}

void kkt_release(KktBuffer *buffer) {
  free(buffer->block);
  *buffer = (KktBuffer){0};
}

void kkt_push(KktArena *arena, KktList *list, int item) {
  if (list->count == list->capacity) {
    int capacity = list->capacity ? 2 * list->capacity : 8;
    int *items = kkt_take(arena, (size_t)capacity, sizeof(int));
    if (list->count) memcpy(items, list->items, sizeof(int) * (size_t)list->count);
    list->items = items;
    list->capacity = capacity;
  }
  list->items[list->count++] = item;
}
