# Draws the image of a scene by parts:
#
#     make -j 8 -f parts.mk SCENE=scene.toml PARTS=64 IMAGE=image.png
#
# Parts that exist and are newer than the scene are kept.

SCENE ?= scene.toml
PARTS ?= 16
IMAGE ?= image.png
FOLDER ?= $(IMAGE).parts
SHEETSPLAT ?= sheetsplat

parts := $(patsubst %,$(FOLDER)/%.exr,$(shell seq $(PARTS)))

$(IMAGE): $(parts)
	$(SHEETSPLAT) merge $^ -o $@

$(parts): $(FOLDER)/%.exr: $(FOLDER)/of-$(PARTS).txt
	$(SHEETSPLAT) render $(SCENE) --backend cpu --overwrite -o $@ $$(sed -n $*p $<)

# Other numbers of parts divide the image elsewhere, so that their parts do not merge.
$(FOLDER)/of-$(PARTS).txt: $(SCENE)
	mkdir -p $(FOLDER)
	rm -f $(FOLDER)/of-*.txt
	$(SHEETSPLAT) split $(SCENE) -n $(PARTS) > $@

.DELETE_ON_ERROR:
